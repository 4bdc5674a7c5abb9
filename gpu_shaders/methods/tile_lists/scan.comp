// Where the list of each tile begins: the sum of the counts before it. One group of threads, each of which has its own part.
#include "methods/tile_lists/seen.glsl"

layout(local_size_x = 1024) in;

layout(std430, binding = 9) buffer TileCounts {
    uint tile_counts[]; // then where the next entry of each tile goes
};
layout(std430, binding = 10) writeonly buffer TileStarts {
    uint tile_starts[]; // one more than there are tiles
};

uniform uint list_count;
uniform uint seen_capacity;
uniform uint entry_capacity;

const uint MOST_ENTRIES = 0x7fffffffu; // more than fit anywhere

shared uint sums[1024];

void main() {
    uint own = gl_LocalInvocationIndex;
    uint part_count = (list_count + 1023u) / 1024u;
    uint first = own * part_count;
    uint sum = 0u, longest = 0u;
    for (uint i = 0u; i < part_count; i++) {
        uint count = first + i < list_count ? tile_counts[first + i] : 0u;
        sum = min(sum + min(count, MOST_ENTRIES), MOST_ENTRIES);
        longest = max(longest, count);
    }
    sums[own] = sum;
    for (uint step = 0u; step < 10u; step++) {
        memoryBarrierShared();
        barrier();
        uint before = own >= 1u << step ? sums[own - (1u << step)] : 0u;
        memoryBarrierShared();
        barrier();
        sums[own] = min(sums[own] + before, MOST_ENTRIES);
    }
    memoryBarrierShared();
    barrier();
    // Where not everything has room there are no lists: they would have holes. The counts tell how much is needed.
    bool fits = sums[1023] <= entry_capacity && counts.seen_count <= seen_capacity;
    uint start = fits ? sums[own] - sum : 0u;
    for (uint i = 0u; i < part_count; i++) {
        if (first + i < list_count) {
            uint count = tile_counts[first + i];
            tile_starts[first + i] = start;
            tile_counts[first + i] = start;
            start += fits ? count : 0u;
        }
    }
    atomicMax(counts.longest_list, longest);
    if (own == 1023u) {
        tile_starts[list_count] = fits ? sums[own] : 0u;
        counts.entry_count = sums[own];
        uint group_count = fits ? (counts.seen_count + 127u) / 128u : 0u;
        counts.fill_groups[0] = min(group_count, 32768u);
        counts.fill_groups[1] = (group_count + 32767u) / 32768u;
        counts.fill_groups[2] = 1u;
        counts.long_groups[2] = 1u;
    }
}
