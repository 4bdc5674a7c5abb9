// Sorts the long lists, a group of threads for each: by counting what comes before each entry, or by bitonic sorting (Batcher
// 1968), in the group's own memory or, where they are too long for it, where they lie.
#define ENTRIES_ACCESS coherent
#include "methods/tile_lists/order.glsl"

layout(local_size_x = 128) in;

const uint THREADS = 128u;
const uint SHARED_ENTRIES = 1024u;
shared uvec2 own_entries[SHARED_ENTRIES];

void sort_by_counting(uint start, uint count) {
    uint own = gl_LocalInvocationIndex;
    if (own < count)
        own_entries[own] = entries[start + own];
    memoryBarrierShared();
    barrier();
    if (own < count) {
        uvec2 entry = own_entries[own];
        uint before = 0u;
        for (uint i = 0u; i < count; i++)
            before += uint(i != own && comes_before(own_entries[i], entry));
        entries[start + before] = entry;
    }
}

// The lower and the upper of the pair that a thread compares, in blocks of 2 `reach`: mirrored in the first step of a stage, else
// `reach` apart. The upper one may be beyond the end; there are the greatest, so it may be left out.
uvec2 pair_of(uint number, uint reach, bool is_mirrored) {
    uint block = number / reach, inside = number % reach;
    uint low = block * 2u * reach + inside;
    return uvec2(low, is_mirrored ? block * 2u * reach + 2u * reach - 1u - inside : low + reach);
}

void order_shared(uint count, uint reach, bool is_mirrored) {
    for (uint first = 0u; first < SHARED_ENTRIES / 2u; first += THREADS) {
        uvec2 pair = pair_of(first + gl_LocalInvocationIndex, reach, is_mirrored);
        if (pair.y < count && comes_before(own_entries[pair.y], own_entries[pair.x])) {
            uvec2 entry = own_entries[pair.x];
            own_entries[pair.x] = own_entries[pair.y];
            own_entries[pair.y] = entry;
        }
    }
    memoryBarrierShared();
    barrier();
}

void order_in_place(uint start, uint count, uint reach, bool is_mirrored) {
    uint pair_count = (count + 2u * reach - 1u) / (2u * reach) * reach;
    for (uint first = 0u; first < pair_count; first += THREADS) {
        uvec2 pair = pair_of(first + gl_LocalInvocationIndex, reach, is_mirrored);
        if (pair.y < count && comes_before(entries[start + pair.y], entries[start + pair.x])) {
            uvec2 entry = entries[start + pair.x];
            entries[start + pair.x] = entries[start + pair.y];
            entries[start + pair.y] = entry;
        }
    }
    memoryBarrierBuffer();
    barrier();
}

// Blocks of 2^stage become sorted.
void sort_shared(uint start, uint count) {
    for (uint i = 0u; i < SHARED_ENTRIES; i += THREADS)
        if (i + gl_LocalInvocationIndex < count)
            own_entries[i + gl_LocalInvocationIndex] = entries[start + i + gl_LocalInvocationIndex];
    memoryBarrierShared();
    barrier();
    for (uint stage = 1u; stage <= 10u && 1u << (stage - 1u) < count; stage++) {
        order_shared(count, 1u << (stage - 1u), true);
        for (uint step = 2u; step <= stage; step++)
            order_shared(count, 1u << (stage - step), false);
    }
    for (uint i = 0u; i < SHARED_ENTRIES; i += THREADS)
        if (i + gl_LocalInvocationIndex < count)
            entries[start + i + gl_LocalInvocationIndex] = own_entries[i + gl_LocalInvocationIndex];
}

void sort_in_place(uint start, uint count) {
    for (uint stage = 1u; stage <= 31u && 1u << (stage - 1u) < count; stage++) {
        order_in_place(start, count, 1u << (stage - 1u), true);
        for (uint step = 2u; step <= stage; step++)
            order_in_place(start, count, 1u << (stage - step), false);
    }
}

void main() {
    uint number = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (number >= counts.long_count)
        return;
    uvec2 list = list_of(tile_counts[number]);
    if (list.y <= THREADS)
        sort_by_counting(list.x, list.y);
    else if (list.y <= SHARED_ENTRIES)
        sort_shared(list.x, list.y);
    else
        sort_in_place(list.x, list.y);
}
