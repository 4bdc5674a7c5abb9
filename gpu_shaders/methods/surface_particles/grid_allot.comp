// Gives each bucket room for its members, in any order.
#include "methods/surface_particles/grid.glsl"

void main() {
    int bucket = grid_thread();
    if (bucket >= bucket_count)
        return;
    uint count = buckets[bucket].y;
    buckets[bucket] = uvec2(count > 0u ? atomicAdd(total, count) : 0u, 0u);
}
