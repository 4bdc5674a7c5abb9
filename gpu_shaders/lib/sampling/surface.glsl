// A ball at the surface that was found, which is the first sample.
#include "lib/ball.glsl"
#include "lib/kernel.glsl"
#include "lib/sampling/samples.glsl"

uniform sampler2D samples_tx;

flat in uint v_id;
flat in vec4 v_sphere;
flat in vec2 v_density;

struct SurfaceShare {
    vec3 gradient; // against it, view space
    float density; // of positive ones, as shares go by these
};

// Leaves the fragment where there is no surface, or the ball does not reach it.
SurfaceShare surface_share() {
    float t = texelFetch(samples_tx, ivec2(gl_FragCoord.xy), 0).x;
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    Ball ball = Ball(v_sphere.xyz, v_sphere.w);
    Chord chord = ball_chord(ball, ray);
    float x = chord_x(chord, t);
    if (t < 0.0 || x <= 0.0)
        discard;
    vec3 gradient = v_density.x * kernel_derivative(x) / chord.radius * ball_from_center(ball, ray, chord, t);
    return SurfaceShare(gradient, max(v_density.x * kernel_value(x), 0.0));
}
