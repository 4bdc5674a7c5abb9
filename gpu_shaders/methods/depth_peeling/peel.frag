// The next crossing of each influence sphere behind the last one of the pixel; the depth test keeps the nearest. Spheres
// are drawn in the order of their ids, so among equal distances the first, which has the least number, stays.
#include "lib/ball.glsl"
#include "methods/depth_peeling/state.glsl"

uniform usampler2D state_tx;
uniform vec2 clip_distances; // planar

flat in uint v_id;
layout(location = 0) out uint out_crossing;

bool is_behind(float depth, uint crossing, State last) {
    return depth > last.depth || (depth == last.depth && crossing > last.crossing);
}

void main() {
    State last = state_unpack(texelFetch(state_tx, ivec2(gl_FragCoord.xy), 0).xy);
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    Chord chord = ball_chord(ball_fetch(v_id), ray);
    float half_length = chord_half_length(chord);
    float start = clip_distances.x * ray.stretch * depth_scale;
    float entry = max((chord.middle - half_length) * depth_scale, start);
    float exit = (chord.middle + half_length) * depth_scale;
    if (!state_is_peeling(last) || chord.peak <= 0.0 || exit <= start || entry > clip_distances.y * ray.stretch * depth_scale)
        discard;
    uint number = 1u + 2u * v_id;
    if (is_behind(entry, number, last)) {
        out_crossing = number;
        gl_FragDepth = entry;
    } else if (is_behind(exit, number + 1u, last)) {
        out_crossing = number + 1u;
        gl_FragDepth = exit;
    } else {
        discard;
    }
}
