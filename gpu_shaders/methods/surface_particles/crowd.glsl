// What particles do to one another within their reach (section 7.3.1).
#include "lib/random.glsl"

// What the particles around a place do there.
struct Pressure {
    vec3 force;    // the sum of (1 - r / h)^2 times the direction from each (equation 6, times h / 3)
    float density; // the sum of (1 - r / h)^3 (equation 5, scaled so that a particle has the density 1 where it is)
    float company; // how many there are
};

// Adds one of two particles that face the same way to the pressure on the other, whose number is `pushed`.
void pressure_add(inout Pressure pressure, vec3 offset, vec3 normal, vec3 other_normal, float reach, int pushed) {
    float squared = dot(offset, offset);
    if (squared >= reach * reach || dot(normal, other_normal) <= 0.0)
        return;
    float way = sqrt(squared), share = 1.0 - way / reach;
    pressure.force += share * share * (way > 0.0 ? offset / way : random_direction(uint(pushed)));
    pressure.density += share * share * share;
    pressure.company += 1.0;
}
