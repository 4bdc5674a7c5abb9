// The surface as the renderer wants it: world-space normal, planar depth, colour.
#include "lib/ray.glsl"
#include "methods/depth_peeling/state.glsl"

uniform usampler2D state_tx;
uniform sampler2D gradient_tx;
uniform sampler2D color_sum_tx;
uniform mat3 world_from_view;

layout(location = 0) out vec4 out_surface; // normal, planar depth (infinite: none)
layout(location = 1) out vec4 out_color;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    State state = state_unpack(texelFetch(state_tx, pixel, 0).xy);
    out_surface = vec4(vec3(0.0), uintBitsToFloat(0x7f800000u));
    out_color = vec4(0.0);
    if (!state_has_surface(state))
        return;
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    vec3 gradient = texelFetch(gradient_tx, pixel, 0).xyz;
    float steepness = length(gradient);
    vec3 normal = steepness > 0.0 ? gradient / steepness : vec3(0.0);
    vec4 color = texelFetch(color_sum_tx, pixel, 0);
    out_surface = vec4(world_from_view * normal, state.depth / (depth_scale * ray.stretch));
    out_color = vec4(color.rgb / max(color.a, 1e-30), 1.0);
}
