// What a ball gives to the ray's next step: its density, the slope, and a bound on how fast the slope can change until the end
// of the window; by blending. Balls beyond the window tell where they begin.
#include "lib/kernel.glsl"
#include "methods/depth_peeling/clip.glsl"

uniform usampler2D state_tx;

flat in vec4 v_sphere;
flat in vec2 v_density;
layout(location = 0) out vec4 out_sums; // density, slope, bound; least entry, scaled

void main() {
    uvec4 texel = texelFetch(state_tx, ivec2(gl_FragCoord.xy), 0);
    State state = state_unpack(texel.xy);
    if (state.phase != PHASE_WALKING)
        discard;
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    Chord chord = ball_chord(Ball(v_sphere.xyz, v_sphere.w), ray);
    float half_length = chord_half_length(chord);
    float begin = state.depth / depth_scale, end = begin + uintBitsToFloat(texel.z);
    float entry = chord.middle - half_length;
    if (chord.peak <= 0.0 || chord.middle + half_length <= begin)
        discard;
    out_sums = vec4(0.0, 0.0, 0.0, NO_SURFACE);
    if (entry > end) {
        out_sums.w = entry * depth_scale;
        return;
    }
    float weight = state.is_inside ? -v_density.x : v_density.x;
    float from_middle = (begin - chord.middle) / chord.radius;
    float x = chord.peak - from_middle * from_middle;
    out_sums.x = weight * kernel_value(x);
    out_sums.y = weight * kernel_derivative(x) * -2.0 * from_middle / chord.radius;
    out_sums.z = abs(weight) * kernel_slope_change(chord.peak) / (chord.radius * chord.radius);
#if KERNEL_DEGREE == 2
    // A linear kernel's slope jumps up where the ray enters a ball, and where it leaves one from a slope downwards.
    if (x <= 0.0)
        out_sums.y = max(weight, 0.0) * KERNEL_LOW * 2.0 * sqrt(chord.peak) / chord.radius;
    else if (weight > 0.0 && chord.middle + half_length < end)
        out_sums.y = max(out_sums.y, 0.0);
#endif
}
