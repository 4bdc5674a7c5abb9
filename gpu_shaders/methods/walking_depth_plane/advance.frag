// Moves the plane by what the samples say, or narrows the bracket.
#include "lib/ray.glsl"
#include "methods/walking_depth_plane/walk.glsl"

uniform sampler2D samples_tx;
uniform sampler2D side_tx;
uniform sampler2D near_tx; // see ahead.frag
uniform sampler2D far_tx;
uniform sampler2D place_tx;
uniform sampler2D pace_tx;
uniform sampler2D bracket_tx;
uniform vec2 clip_distances; // planar

layout(location = 0) out vec4 out_place;
layout(location = 1) out vec2 out_pace;
layout(location = 2) out vec4 out_bracket;

// A step may be so many times the oracle's at its start; else a rising density would let the plane go one sample a pass.
const float LONGER = 2.0;

// Goes as far as the samples allow. `limit` and `is_empty` are what blending has found: where a smaller ball begins or, where no ball
// reaches the last sample, the next one.
void advance(inout Walk walk, inout Bracket bracket, vec4 samples, vec4 values, float limit, bool is_empty) {
    for (int i = 0; i < 4; i++) {
        if (samples[i] > limit) {
            walk = walk_on_behind(walk, limit);
            return;
        }
        if (values[i] >= 0.0) {
            bracket = Bracket(walk.t, samples[i], walk.value, values[i]);
            walk.first = HAS_STOPPED;
            return;
        }
        if (i > 0 && walk.spacing > LONGER * oracle_forward(walk.value, walk.pace)) {
            walk = walk_on(walk);
            return;
        }
        walk.t = samples[i];
        walk.value = values[i];
    }
    if (is_empty && limit <= walk_horizon(walk, samples.w) && limit < NOTHING) {
        walk = walk_leap(walk, limit);
    } else if (is_empty && walk.looks_far) {
        walk.first = HAS_STOPPED;
    } else {
        walk.looks_far = is_empty;
        walk = walk_on(walk);
    }
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Walk walk = walk_unpack(texelFetch(place_tx, pixel, 0), texelFetch(pace_tx, pixel, 0).xy);
    Bracket bracket = bracket_unpack(texelFetch(bracket_tx, pixel, 0));
    vec4 samples = texelFetch(samples_tx, pixel, 0);
    if (samples.x >= 0.0) {
        vec4 near = texelFetch(near_tx, pixel, 0), far = texelFetch(far_tx, pixel, 0);
        vec4 values = texelFetch(side_tx, pixel, 0).x * (vec4(near.xyz, far.x) - threshold);
        if (bracket_is_there(bracket))
            bracket = bracket_narrow(bracket, samples, values);
        else {
            walk.pace = far.w < NOTHING ? far.w : walk.pace;
            advance(walk, bracket, samples, values, near.w, far.y < 0.5);
        }
        if (walk.t > clip_distances.y * ray_from_pixel(gl_FragCoord.xy).stretch)
            walk.first = HAS_STOPPED;
    }
    out_place = walk_pack_place(walk);
    out_pace = walk_pack_pace(walk);
    out_bracket = bracket_pack(bracket);
}
