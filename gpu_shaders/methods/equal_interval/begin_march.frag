// Each ray before its first sample, at the near clip distance.
#include "lib/ray.glsl"
#include "methods/equal_interval/march.glsl"

uniform sampler2D side_tx;
uniform sampler2D barrier_tx;
uniform float depth_scale;
uniform vec2 clip_distances; // planar

layout(location = 0) out vec4 out_march;
layout(location = 1) out vec4 out_bracket;

void main() {
    float start = clip_distances.x * ray_from_pixel(gl_FragCoord.xy).stretch;
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec2 side = texelFetch(side_tx, pixel, 0).xy;
    March march = March(start, side.y, start, GOING, 0);
    out_march = march_pack(march);
    out_bracket = past_pack(Past(start, NO_PAST, 1.0, 0.0));
    gl_FragDepth = march_depth(march, side, texelFetch(barrier_tx, pixel, 0).x, depth_scale);
}
