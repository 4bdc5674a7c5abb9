// The density kernels; of those that are polynomials also how fast their slopes change, and the polynomials over an interval of a
// ray in Bernstein form.
// With KERNEL_IS_POLYNOMIAL f(x) = x^KERNEL_POWER (KERNEL_LOW + KERNEL_HIGH x); KERNEL_DEGREE: 2, 4, 6 or 8, its degree along a
// ray. With KERNEL_IS_PROFILE f is linear between the entries of a table, at even steps of s = sqrt(1 - x). Else it is (1 - s)^2
// (Mishima et al. 2008, equation 7).
#include "lib/chord.glsl"

#if KERNEL_IS_POLYNOMIAL

float kernel_power(float x) {
    float result = x;
    for (int i = 1; i < KERNEL_POWER; i++)
        result *= x;
    return result;
}

float kernel_value(float x) {
    return x <= 0.0 ? 0.0 : kernel_power(x) * (KERNEL_LOW + KERNEL_HIGH * x);
}

float kernel_derivative(float x) {
    return x <= 0.0 ? 0.0 : kernel_power(x) * (float(KERNEL_POWER) * KERNEL_LOW / x + float(KERNEL_POWER + 1) * KERNEL_HIGH);
}

float kernel_second_derivative(float x) {
#if KERNEL_POWER == 1
    return x <= 0.0 ? 0.0 : 2.0 * KERNEL_HIGH;
#elif KERNEL_POWER == 2
    return x <= 0.0 ? 0.0 : 2.0 * KERNEL_LOW + 6.0 * KERNEL_HIGH * x;
#else
    return x <= 0.0 ? 0.0 : x * x * (12.0 * KERNEL_LOW + 20.0 * KERNEL_HIGH * x);
#endif
}

// The greatest |F''| along a chord, times R^2: of x^n it is 2 for n = 1, 8 a for 2, 6 a^2 for 3 and 8 a^3 for 4, where a is x
// at the chord's middle.
float kernel_slope_change(float a) {
#if KERNEL_POWER == 1
    return 2.0 * KERNEL_LOW;
#elif KERNEL_POWER == 2
    return (8.0 * KERNEL_LOW + 6.0 * KERNEL_HIGH * a) * a;
#else
    return 8.0 * KERNEL_LOW * a * a * a;
#endif
}

// How fast the slope of f along a chord rises at most, and how fast it falls, times R^2; a: x at the chord's middle. A little
// more, so that rounding cannot make it too little. Of (1 - u^2)^n the second derivative reaches 8 for n = 2, 24/5 for 3 and
// 256/49 for 4, and -2 n at the middle. A linear kernel jumps where it begins, which is not counted.
float kernel_steepest_rise(float a) {
#if KERNEL_POWER == 1
    return 0.0;
#elif KERNEL_POWER == 2
    return 1.00001 * a * (8.0 * KERNEL_LOW + 4.8 * KERNEL_HIGH * a);
#else
    return 1.00001 * a * a * a * (256.0 / 49.0) * KERNEL_LOW;
#endif
}

float kernel_steepest_fall(float a) {
#if KERNEL_POWER == 1
    return 1.00001 * 2.0 * KERNEL_LOW;
#elif KERNEL_POWER == 2
    return 1.00001 * a * (4.0 * KERNEL_LOW + 6.0 * KERNEL_HIGH * a);
#else
    return 1.00001 * a * a * a * 8.0 * KERNEL_LOW;
#endif
}

// x over [begin, end] as a quadratic in Bernstein form.
vec3 kernel_chord_bernstein(Chord chord, float begin, float end) {
    float from = (begin - chord.middle) / chord.radius;
    float to = (end - chord.middle) / chord.radius;
    return chord.peak - vec3(from * from, from * to, to * to);
}

// Adds weight f(x) over [begin, end] to the coefficients (Kanamori et al. 2008, appendix A; here the products of the
// quadratic x replace the clipping of the polynomial of the whole chord: fewer operations, and nothing cancels).
void kernel_add_bernstein(inout float total[KERNEL_DEGREE + 1], Chord chord, float weight, float begin, float end) {
    vec3 x = kernel_chord_bernstein(chord, begin, end);
#if KERNEL_DEGREE == 2
    total[0] += weight * x[0];
    total[1] += weight * x[1];
    total[2] += weight * x[2];
#else
    // x^2
    float s0 = x[0] * x[0], s1 = x[0] * x[1], s2 = (x[0] * x[2] + 2.0 * x[1] * x[1]) / 3.0, s3 = x[1] * x[2], s4 = x[2] * x[2];
#if KERNEL_DEGREE == 4
    total[0] += weight * s0;
    total[1] += weight * s1;
    total[2] += weight * s2;
    total[3] += weight * s3;
    total[4] += weight * s4;
#elif KERNEL_DEGREE == 6
    // x^2 y
    vec3 y = weight * (KERNEL_LOW + KERNEL_HIGH * x);
    total[0] += s0 * y[0];
    total[1] += (2.0 * s1 * y[0] + s0 * y[1]) / 3.0;
    total[2] += (6.0 * s2 * y[0] + 8.0 * s1 * y[1] + s0 * y[2]) / 15.0;
    total[3] += (s3 * y[0] + 3.0 * s2 * y[1] + s1 * y[2]) / 5.0;
    total[4] += (s4 * y[0] + 8.0 * s3 * y[1] + 6.0 * s2 * y[2]) / 15.0;
    total[5] += (s4 * y[1] + 2.0 * s3 * y[2]) / 3.0;
    total[6] += s4 * y[2];
#else
    // (x^2)^2
    total[0] += weight * s0 * s0;
    total[1] += weight * s0 * s1;
    total[2] += weight * (3.0 * s0 * s2 + 4.0 * s1 * s1) / 7.0;
    total[3] += weight * (s0 * s3 + 6.0 * s1 * s2) / 7.0;
    total[4] += weight * (s0 * s4 + 16.0 * s1 * s3 + 18.0 * s2 * s2) / 35.0;
    total[5] += weight * (s1 * s4 + 6.0 * s2 * s3) / 7.0;
    total[6] += weight * (3.0 * s2 * s4 + 4.0 * s3 * s3) / 7.0;
    total[7] += weight * s3 * s4;
    total[8] += weight * s4 * s4;
#endif
#endif
}

#elif KERNEL_IS_PROFILE

uniform sampler2D profile_tx;

// The densities of the entries around s, and how far it lies behind the first.
vec3 kernel_entries(float s) {
    int last = textureSize(profile_tx, 0).x - 1;
    int entry = clamp(int(s * float(last)), 0, last - 1);
    float begin = texelFetch(profile_tx, ivec2(entry, 0), 0).x, end = texelFetch(profile_tx, ivec2(entry + 1, 0), 0).x;
    return vec3(begin, end, s * float(last) - float(entry));
}

float kernel_value(float x) {
    if (x <= 0.0)
        return 0.0;
    vec3 entries = kernel_entries(sqrt(max(1.0 - x, 0.0)));
    return mix(entries.x, entries.y, entries.z);
}

float kernel_derivative(float x) {
    float s = sqrt(max(1.0 - x, 0.0));
    vec3 entries = kernel_entries(s);
    float steps = float(textureSize(profile_tx, 0).x - 1);
    return x <= 0.0 ? 0.0 : (entries.x - entries.y) * steps / (2.0 * max(s, KERNEL_LEAST_SHARE));
}

#else

float kernel_value(float x) {
    // 1 - s without cancellation.
    float root = max(x, 0.0) / (1.0 + sqrt(max(1.0 - x, 0.0)));
    return root * root;
}

// Towards the centre the slope by x grows without bound, but not that by s, which is what a gradient has.
float kernel_derivative(float x) {
    float s = max(sqrt(max(1.0 - x, 0.0)), KERNEL_LEAST_SHARE);
    return x <= 0.0 ? 0.0 : x / ((1.0 + s) * s);
}

#endif
