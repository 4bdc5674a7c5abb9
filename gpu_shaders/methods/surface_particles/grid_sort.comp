// Orders the members of each bucket: threads come as they like; sums must not.
#include "methods/surface_particles/grid.glsl"

void main() {
    int bucket = grid_thread();
    if (bucket >= bucket_count)
        return;
    uint begin = buckets[bucket].x, count = min(buckets[bucket].y, MOST_MEMBERS);
    for (uint i = 1u; i < count; i++) {
        uint member = members[begin + i];
        uint free = i;
        for (uint j = 0u; j < i; j++) {
            uint before = members[begin + i - 1u - j];
            if (before <= member)
                break;
            members[begin + free] = before;
            free--;
        }
        members[begin + free] = member;
    }
}
