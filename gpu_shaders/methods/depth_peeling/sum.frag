// Adds a ball's share to the density over the interval between the last crossing and the next, by blending.
#include "lib/kernel.glsl"
#include "methods/depth_peeling/state.glsl"

uniform usampler2D state_tx;
uniform sampler2D depth_tx;

flat in uint v_id;
layout(location = 0) out vec4 out_density_0;
layout(location = 1) out vec4 out_density_1;
layout(location = 2) out vec4 out_density_2;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    State state = state_unpack(texelFetch(state_tx, pixel, 0).xy);
    float depth = texelFetch(depth_tx, pixel, 0).x;
    if (!state_is_peeling(state) || state.crossing == 0u || depth == 1.0)
        discard;
    float begin = state.depth / depth_scale, end = depth / depth_scale;
    Chord chord = ball_chord(ball_fetch(v_id), ray_from_pixel(gl_FragCoord.xy));
    // A ball that is in the interval anywhere is in all of it; its middle is the safest place to ask.
    if (abs(0.5 * (begin + end) - chord.middle) >= chord_half_length(chord))
        discard;
    float density[KERNEL_DEGREE + 1];
    for (int i = 0; i <= KERNEL_DEGREE; i++)
        density[i] = 0.0;
    kernel_add_bernstein(density, chord, ball_density(v_id).x, begin, end);
    vec4 sums[3] = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
    for (int i = 0; i <= KERNEL_DEGREE; i++)
        sums[i / 4][i % 4] = density[i];
    out_density_0 = sums[0];
    out_density_1 = sums[1];
    out_density_2 = sums[2];
}
