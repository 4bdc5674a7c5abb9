// What particles do to one another within their reach (section 7.3.1): two push one another where they are nearer than the lesser of
// their reaches, h. They are looked for on the level of one of them, whose cells are as wide as the reach of the farthest, or the half
// of that, or a quarter.
#include "lib/random.glsl"

uniform float reach;      // influence radii
uniform float widest;     // the widest cell, a little more than the farthest reach, Blender units
uniform int level_count;

// Reaches may be rounded.
const float LEVEL_SLACK = 1.0001;

// The level of what reaches so far.
int level_of(float own_reach) {
    return int(clamp(log2(widest / (LEVEL_SLACK * own_reach)), 0.0, float(level_count - 1)));
}

float level_side(int level) {
    return widest * exp2(-float(level));
}

// What the particles around a place do there.
struct Pressure {
    vec3 force;    // the sum of (1 - r / h)^2 times the direction from each (equation 6, times h / 3)
    float density; // the sum of (1 - r / h)^3 (equation 5, scaled so that a particle has the density 1 where it is)
    float company; // how many there are
};

// Adds one of two particles that face the same way to the pressure on the other, whose number is `pushed`.
void pressure_add(inout Pressure pressure, vec3 offset, vec3 normal, vec3 other_normal, float h, int pushed) {
    float squared = dot(offset, offset);
    if (squared >= h * h || dot(normal, other_normal) <= 0.0)
        return;
    float way = sqrt(squared), share = 1.0 - way / h;
    pressure.force += share * share * (way > 0.0 ? offset / way : random_direction(uint(pushed)));
    pressure.density += share * share * share;
    pressure.company += 1.0;
}
