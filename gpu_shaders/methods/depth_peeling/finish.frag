// The surface as the renderer wants it: world-space normal, planar depth, colour.
#include "lib/ray.glsl"
#include "methods/depth_peeling/state.glsl"

uniform usampler2D state_tx;
uniform sampler2D gradient_tx;
uniform sampler2D color_sum_tx;
uniform mat3 world_from_view;
uniform vec2 part_corner; // of this part of the image in what is drawn into, pixels

layout(location = 0) out float out_depth;
layout(location = 1) out vec4 out_normal;
layout(location = 2) out vec4 out_color;

void main() {
    vec2 position = gl_FragCoord.xy - part_corner;
    ivec2 pixel = ivec2(position);
    State state = state_unpack(texelFetch(state_tx, pixel, 0).xy);
    out_depth = DEPTH_BACKGROUND;
    out_normal = vec4(0.0);
    out_color = vec4(0.0);
    if (!state_has_surface(state))
        return;
    Ray ray = ray_from_pixel(position);
    vec3 gradient = texelFetch(gradient_tx, pixel, 0).xyz;
    float steepness = length(gradient);
    vec3 normal = steepness > 0.0 ? gradient / steepness : vec3(0.0);
    vec4 color = texelFetch(color_sum_tx, pixel, 0);
    out_depth = min(state.depth / (depth_scale * ray.stretch), DEPTH_BACKGROUND);
    out_normal = vec4(world_from_view * normal, 1.0);
    out_color = vec4(color.rgb / max(color.a, 1e-30), 1.0);
}
