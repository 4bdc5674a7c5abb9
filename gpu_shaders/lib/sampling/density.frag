// Adds the ball's density at the four samples of each pixel, by blending (Mishima et al. 2008, sections 4.1 and 4.2).
#include "lib/kernel.glsl"
#include "lib/sampling/samples.glsl"

uniform sampler2D samples_tx;

flat in vec4 v_sphere;
flat in vec2 v_density;
layout(location = 0) out vec4 out_density;

void main() {
    vec4 samples = texelFetch(samples_tx, ivec2(gl_FragCoord.xy), 0);
    Chord chord = ball_chord(Ball(v_sphere.xyz, v_sphere.w), ray_from_pixel(gl_FragCoord.xy));
    vec4 from_middle = (samples - chord.middle) / chord.radius;
    vec4 x = chord.peak - from_middle * from_middle;
    if (!samples_asked(samples) || all(lessThanEqual(x, vec4(0.0))))
        discard;
    out_density = v_density.x * vec4(kernel_value(x.x), kernel_value(x.y), kernel_value(x.z), kernel_value(x.w));
}
