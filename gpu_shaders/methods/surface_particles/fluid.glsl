// The density at points and what it changes with (section 7.2). The same as native/core/src/surface_particles/fluid.rs.
#include "lib/kernel.glsl"
#include "methods/surface_particles/hash.glsl"

uniform sampler2D motion_tx; // velocity of a ball, units a second; weight
uniform float isovalue;

// How often a point is moved onto the surface, how far at most and how near it must come, in influence radii.
const int FLUID_PROJECTIONS = 8;
const float FLUID_LONGEST_PROJECTION = 0.25;
const float FLUID_NEAR = 1e-4;

// What the balls give at a point.
struct Sample {
    float density; // F
    vec3 gradient; // of F by the point
    float rate;    // how fast F changes because balls move
    vec3 velocity; // of the balls, weighted by the lengths of their gradients (equation 3)
    float scale;   // the harmonic mean of their influence radii, weighted by the lengths of their gradients; 0 where none reaches
};

struct SurfacePoint {
    bool is_there;
    vec3 position;
    vec3 normal;
    float scale; // as that of the sample
};

// `sums`: of the lengths of gradients, and of these by the influence radii.
void fluid_add_ball(inout Sample found, inout vec2 sums, vec3 point, int ball) {
    vec4 sphere = hash_sphere(ball);
    vec3 offset = point - sphere.xyz;
    float x = 1.0 - dot(offset, offset) / (sphere.w * sphere.w);
    if (x <= 0.0)
        return;
    vec4 motion = texelFetch(motion_tx, hash_texel(uint(ball)), 0);
    vec3 slope = -2.0 * motion.w * kernel_derivative(x) / (sphere.w * sphere.w) * offset;
    float slope_length = length(slope);
    found.density += motion.w * kernel_value(x);
    found.gradient += slope;
    found.rate -= dot(slope, motion.xyz);
    found.velocity += slope_length * motion.xyz;
    sums += slope_length * vec2(1.0, 1.0 / sphere.w);
}

Sample fluid_sample(vec3 point) {
    Sample found = Sample(0.0, vec3(0.0), 0.0, vec3(0.0), 0.0);
    vec2 sums = vec2(0.0);
    int count = hash_levels();
    for (int level = 0; level < count; level++) {
        Bucket bucket = hash_find(level, point);
        for (uint i = 0u; i < bucket.count; i++) {
            int ball = hash_ball(bucket, i);
            if (ball >= 0)
                fluid_add_ball(found, sums, point, ball);
        }
    }
    if (sums.x > 0.0) {
        found.velocity /= sums.x;
        found.scale = sums.x / sums.y;
    }
    return found;
}

// The point of the surface that the slope leads to from a point near it.
SurfacePoint fluid_projected(vec3 position) {
    for (int i = 0; i < FLUID_PROJECTIONS; i++) {
        Sample found = fluid_sample(position);
        float slope = length(found.gradient);
        if (!(slope > 0.0))
            break;
        float way = (isovalue - found.density) / slope;
        vec3 normal = -found.gradient / slope;
        if (abs(way) <= FLUID_NEAR * found.scale)
            return SurfacePoint(true, position - way * normal, normal, found.scale);
        float longest = FLUID_LONGEST_PROJECTION * found.scale;
        position -= clamp(way, -longest, longest) * normal;
    }
    return SurfacePoint(false, position, vec3(0.0), 0.0);
}

// The velocity of a point that stays on the surface and moves as desired where it may (equation 2, corrected: the desired velocity
// is its first term). `feedback` is the share of the excess of density that goes in a second, `rate` how fast F changes there.
vec3 fluid_constrained(Sample found, vec3 desired, float rate, float feedback) {
    float steepness = dot(found.gradient, found.gradient);
    if (!(steepness > 0.0))
        return desired;
    float excess = dot(found.gradient, desired) + rate + feedback * (found.density - isovalue);
    return desired - excess / steepness * found.gradient;
}
