// Adds a ball's pull on the gradient and its share of the colour at the surface, by blending (Kanamori et al. 2008,
// section 4, step 4).
#include "lib/ball.glsl"
#include "lib/kernel.glsl"
#include "methods/depth_peeling/state.glsl"

uniform usampler2D state_tx;
#if WITH_COLORS
uniform sampler2D color_tx;
#endif

flat in uint v_id;
flat in vec4 v_sphere;
flat in vec2 v_density;
layout(location = 0) out vec4 out_gradient; // view space, against the gradient
layout(location = 1) out vec4 out_color;    // times the density, density

void main() {
    State state = state_unpack(texelFetch(state_tx, ivec2(gl_FragCoord.xy), 0).xy);
    if (!state_has_surface(state))
        discard;
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    Ball ball = Ball(v_sphere.xyz, v_sphere.w);
    Chord chord = ball_chord(ball, ray);
    float t = state.depth / depth_scale;
    float x = chord_x(chord, t);
    if (x <= 0.0)
        discard;
    out_gradient = vec4(v_density.x * kernel_derivative(x) / chord.radius * ball_from_center(ball, ray, chord, t), 0.0);
    float share = max(v_density.x * kernel_value(x), 0.0);
#if WITH_COLORS
    out_color = vec4(share * texelFetch(color_tx, ball_texel(v_id), 0).rgb, share);
#else
    out_color = vec4(0.0, 0.0, 0.0, share);
#endif
}
