// The surface as the renderer wants it: planar depth, world-space normal, attributes.
#include "lib/ray.glsl"
#include "lib/sampling/samples.glsl"

uniform sampler2D samples_tx;
uniform sampler2D gradient_sum_tx;
uniform mat3 world_from_view;
uniform vec2 part_corner; // of this part of the image in what is drawn into, pixels

layout(location = 0) out float out_depth;
layout(location = 1) out vec4 out_normal;
#if WITH_COLORS
uniform sampler2D color_sum_tx;
layout(location = COLOR_LOCATION) out vec4 out_color;
#endif
#if WITH_VELOCITIES
uniform sampler2D velocity_sum_tx;
layout(location = VELOCITY_LOCATION) out vec4 out_velocity;
#endif
#if WITH_BALLS
uniform usampler2D dominant_tx;
layout(location = BALL_LOCATION) out int out_ball;
#endif

void main() {
    vec2 position = gl_FragCoord.xy - part_corner;
    ivec2 pixel = ivec2(position);
    float t = texelFetch(samples_tx, pixel, 0).x;
    bool is_there = t >= 0.0;
    vec4 gradient = texelFetch(gradient_sum_tx, pixel, 0);
    // Squares of great weights may be more than floats hold.
    float steepness = max(max(abs(gradient.x), abs(gradient.y)), abs(gradient.z));
    vec3 normal = steepness > 0.0 ? normalize(gradient.xyz / steepness) : vec3(0.0);
    float density = max(gradient.w, 1e-30);
    out_depth = is_there ? min(t / ray_from_pixel(position).stretch, DEPTH_BACKGROUND) : DEPTH_BACKGROUND;
    out_normal = is_there ? vec4(world_from_view * normal, 1.0) : vec4(0.0);
#if WITH_COLORS
    out_color = is_there ? texelFetch(color_sum_tx, pixel, 0) / density : vec4(0.0);
#endif
#if WITH_VELOCITIES
    out_velocity = is_there ? texelFetch(velocity_sum_tx, pixel, 0) / density : vec4(0.0);
#endif
#if WITH_BALLS
    out_ball = is_there ? int(texelFetch(dominant_tx, pixel, 0).x) - 1 : -1;
#endif
}
