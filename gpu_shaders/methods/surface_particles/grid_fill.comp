// Puts the particles into the buckets.
#include "methods/surface_particles/grid.glsl"

void main() {
    int particle = grid_thread();
    if (particle >= particle_count)
        return;
    vec4 place = particle_place(particle);
    if (place.w <= 0.0)
        return;
    uint bucket = grid_bucket_of(place);
    members[buckets[bucket].x + atomicAdd(buckets[bucket].y, 1u)] = uint(particle);
}
