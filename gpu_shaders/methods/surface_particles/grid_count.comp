// Counts the members of each bucket.
#include "methods/surface_particles/grid.glsl"

void main() {
    int particle = grid_thread();
    if (particle >= particle_count)
        return;
    vec4 place = particle_place(particle);
    if (place.w > 0.0)
        atomicAdd(buckets[grid_bucket_of(place)].y, 1u);
}
