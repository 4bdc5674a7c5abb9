// The density at points, of the balls that an inverted spatial hash tells (van Kooten, van den Bergen and Telea 2007, section 7.2): a
// ball is in every cell that it reaches. Each octave of radii has cells of its own size; entries know their cells, so that no ball
// is met twice where two of its cells share a bucket. The same as native/core/src/surface_particles/hash.rs and fluid.rs.
#include "lib/kernel.glsl"

uniform usampler2D level_tx; // the side of a cell as bits of a float, the number of buckets, a power of two, the first bucket, and the first entry
uniform usampler2D start_tx; // of each bucket the first entry, counted in its level; then the end of the level
uniform usampler2D entry_tx; // ball, tag of the cell
uniform sampler2D ball_tx;   // centre from the anchor, influence radius
uniform sampler2D motion_tx; // velocity, units a second; weight
uniform float isovalue;

const ivec3 FLUID_PRIMES = ivec3(11113, 12979, 13513);
const float FLUID_FARTHEST_CELL = 1073741824.0;
// How often a point is moved onto the surface, how far at most and how near it must come, in influence radii.
const int FLUID_PROJECTIONS = 8;
const float FLUID_LONGEST_PROJECTION = 0.25;
const float FLUID_NEAR = 1e-3;

// What the balls give at a point.
struct Sample {
    float density;  // F
    vec3 gradient;  // of F by the point
    float rate;     // how fast F changes because balls move
    vec3 velocity;  // of the balls, weighted by the lengths of their gradients (equation 3)
    float radius;   // the least influence radius of the balls that reach the point, 0 where none does
};

struct SurfacePoint {
    bool is_there;
    vec3 position;
    vec3 normal;
};

ivec2 fluid_texel(uint row) {
    return ivec2(row % uint(ROW_TEXTURE_WIDTH), row / uint(ROW_TEXTURE_WIDTH));
}

ivec3 fluid_cell(vec3 point, float side) {
    return ivec3(clamp(floor(point / side), -FLUID_FARTHEST_CELL, FLUID_FARTHEST_CELL));
}

// Differs among cells which are less than 1024 apart.
uint fluid_tag(ivec3 cell) {
    uvec3 low = uvec3(cell) & 1023u;
    return low.x | low.y << 10u | low.z << 20u;
}

// The bucket of a cell (equation 4).
uint fluid_bucket(ivec3 cell, uint buckets) {
    ivec3 scaled = FLUID_PRIMES * cell;
    int sum = scaled.x + scaled.y + scaled.z;
    return uint(sum < 0 ? -sum : sum) & (buckets - 1u);
}

// The entries of the bucket that a point is in, on a level: the first one and the one behind the last.
uvec2 fluid_entries(uvec4 level, ivec3 cell) {
    uint bucket = level.z + fluid_bucket(cell, level.y);
    uint begin = texelFetch(start_tx, fluid_texel(bucket), 0).x, end = texelFetch(start_tx, fluid_texel(bucket + 1u), 0).x;
    return level.w + uvec2(begin, min(end, begin + MOST_ENTRIES));
}

void fluid_add_ball(inout Sample found, inout float lengths, vec3 point, uint ball) {
    vec4 sphere = texelFetch(ball_tx, fluid_texel(ball), 0);
    vec3 offset = point - sphere.xyz;
    float x = 1.0 - dot(offset, offset) / (sphere.w * sphere.w);
    if (x <= 0.0)
        return;
    vec4 motion = texelFetch(motion_tx, fluid_texel(ball), 0);
    vec3 slope = -2.0 * motion.w * kernel_derivative(x) / (sphere.w * sphere.w) * offset;
    float slope_length = length(slope);
    found.density += motion.w * kernel_value(x);
    found.gradient += slope;
    found.rate -= dot(slope, motion.xyz);
    found.velocity += slope_length * motion.xyz;
    found.radius = min(found.radius, sphere.w);
    lengths += slope_length;
}

Sample fluid_sample(vec3 point) {
    const float NONE = 3e38;
    Sample found = Sample(0.0, vec3(0.0), 0.0, vec3(0.0), NONE);
    float lengths = 0.0;
    int levels = min(textureSize(level_tx, 0).x, MOST_LEVELS);
    for (int i = 0; i < levels; i++) {
        uvec4 level = texelFetch(level_tx, ivec2(i, 0), 0);
        ivec3 cell = fluid_cell(point, uintBitsToFloat(level.x));
        uint tag = fluid_tag(cell);
        uvec2 entries = fluid_entries(level, cell);
        for (uint entry = entries.x; entry < entries.y; entry++) {
            uvec2 about = texelFetch(entry_tx, fluid_texel(entry), 0).xy;
            if (about.y == tag)
                fluid_add_ball(found, lengths, point, about.x);
        }
    }
    if (lengths > 0.0)
        found.velocity /= lengths;
    if (found.radius == NONE)
        found.radius = 0.0;
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
        if (abs(way) <= FLUID_NEAR * found.radius)
            return SurfacePoint(true, position - way * normal, normal);
        float longest = FLUID_LONGEST_PROJECTION * found.radius;
        position -= clamp(way, -longest, longest) * normal;
    }
    return SurfacePoint(false, position, vec3(0.0));
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
