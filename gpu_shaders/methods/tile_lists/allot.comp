// Gives each tile's list its place, a thread for each tile: where it begins, in any order of the groups of threads. Notes the tiles
// with long lists.
#include "methods/tile_lists/seen.glsl"

layout(local_size_x = THREADS) in;

layout(std430, binding = 9) buffer TileEnds {
    uint tile_ends[]; // first how many entries there are, then where the next one goes
};
layout(std430, binding = 10) writeonly buffer TileStarts {
    uint tile_starts[]; // then the tiles with long lists
};

uniform uint list_count;

const uint MOST_ENTRIES = 0x7fffffffu; // more than fit anywhere

shared uint sums[THREADS];
shared uint first_entry;
shared uint longest;

// Each thread's sum becomes that of all threads up to it.
void sum_up(uint own) {
    for (uint step = 0u; step < SUM_STEPS; step++) {
        uint reach = 1u << step;
        memoryBarrierShared();
        barrier();
        uint before = own >= reach ? sums[own - reach] : 0u;
        memoryBarrierShared();
        barrier();
        sums[own] = min(sums[own] + before, MOST_ENTRIES);
    }
}

// Takes room for the entries of all threads. The counter may overflow; then it is noted.
uint taken(uint count) {
    uint start = count > 0u ? atomicAdd(counts.entry_count, count) : 0u;
    if (count >= MOST_ENTRIES || start + count < start)
        counts.has_overflown = 1u;
    return start;
}

// Tiles with long lists come first, those with the longest last.
void note_long(uint tile, uint count) {
    if (count > LONG_LIST) {
        uint number = atomicAdd(counts.longest_count, 1u);
        tile_starts[2u * list_count - 1u - number] = tile;
        atomicMax(counts.longest_groups[0], min(number + 1u, uint(MOST_GROUPS)));
        atomicMax(counts.longest_groups[1], number / uint(MOST_GROUPS) + 1u);
    } else {
        uint number = atomicAdd(counts.long_count, 1u);
        tile_starts[list_count + number] = tile;
        atomicMax(counts.long_groups[0], min(number + 1u, uint(MOST_GROUPS)));
        atomicMax(counts.long_groups[1], number / uint(MOST_GROUPS) + 1u);
    }
}

void main() {
    uint own = gl_LocalInvocationIndex;
    uint tile = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * uint(THREADS) + own;
    uint count = tile < list_count ? tile_ends[tile] : 0u;
    if (own == 0u)
        longest = 0u;
    sums[own] = min(count, MOST_ENTRIES);
    sum_up(own);
    atomicMax(longest, count);
    if (own == uint(THREADS) - 1u)
        first_entry = taken(sums[own]);
    memoryBarrierShared();
    barrier();
    if (own == 0u)
        atomicMax(counts.longest_list, longest);
    if (tile < list_count) {
        uint start = first_entry + sums[own] - count;
        tile_starts[tile] = start;
        tile_ends[tile] = start;
    }
    if (count > SHORT_LIST)
        note_long(tile, count);
    if (tile == 0u) {
        uint group_count = (counts.seen_count + uint(THREADS) - 1u) / uint(THREADS);
        counts.fill_groups[0] = min(group_count, uint(MOST_GROUPS));
        counts.fill_groups[1] = (group_count + uint(MOST_GROUPS) - 1u) / uint(MOST_GROUPS);
        counts.fill_groups[2] = 1u;
        counts.long_groups[2] = 1u;
        counts.longest_groups[2] = 1u;
    }
}
