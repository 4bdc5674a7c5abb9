// Every ray begins to walk at the near clip distance, or where the first ball begins. A ray that meets none stops at once.
#include "lib/ray.glsl"
#include "methods/walking_depth_plane/walk.glsl"

uniform sampler2D side_tx;
uniform sampler2D near_tx; // see ahead.frag; all samples lie at the start
uniform sampler2D far_tx;
uniform vec2 clip_distances; // planar

layout(location = 0) out vec4 out_place;
layout(location = 1) out vec2 out_pace;
layout(location = 2) out vec4 out_bracket;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float stretch = ray_from_pixel(gl_FragCoord.xy).stretch;
    float limit = texelFetch(near_tx, pixel, 0).w, pace = texelFetch(far_tx, pixel, 0).w;
    Walk walk = Walk(clip_distances.x * stretch, texelFetch(side_tx, pixel, 0).y, HAS_STOPPED, 0.0, pace, false);
    if (pace < NOTHING)
        walk = walk_on(walk);
    else if (limit <= clip_distances.y * stretch)
        walk = walk_leap(walk, limit);
    out_place = walk_pack_place(walk);
    out_pace = walk_pack_pace(walk);
    out_bracket = NO_BRACKET;
}
