// Sorts a list with a group of threads: by counting what comes before each entry, or by bitonic sorting (Batcher 1968), in blocks
// that fit into the group's own memory and, where a list is longer, between these where they lie.
#define ENTRIES_ACCESS coherent
#include "methods/tile_lists/order.glsl"

const uint GROUP = uint(SORT_THREADS);
const uint BLOCK = 1u << BLOCK_STAGES;
shared uvec2 own_entries[BLOCK];

void load(uint start, uint count) {
    for (uint i = gl_LocalInvocationIndex; i < count; i += GROUP)
        own_entries[i] = entries[start + i];
    memoryBarrierShared();
    barrier();
}

void store(uint start, uint count) {
    for (uint i = gl_LocalInvocationIndex; i < count; i += GROUP)
        entries[start + i] = own_entries[i];
    memoryBarrierBuffer();
    memoryBarrierShared();
    barrier();
}

void sort_by_counting(uint start, uint count) {
    load(start, count);
    uint own = gl_LocalInvocationIndex;
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

uint pairs_of(uint count, uint reach) {
    return (count + 2u * reach - 1u) / (2u * reach) * reach;
}

void order_own(uint count, uint reach, bool is_mirrored) {
    uint pair_count = pairs_of(count, reach);
    for (uint i = gl_LocalInvocationIndex; i < pair_count; i += GROUP) {
        uvec2 pair = pair_of(i, reach, is_mirrored);
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
    uint pair_count = pairs_of(count, reach);
    for (uint i = gl_LocalInvocationIndex; i < pair_count; i += GROUP) {
        uvec2 pair = pair_of(i, reach, is_mirrored);
        if (pair.y < count && comes_before(entries[start + pair.y], entries[start + pair.x])) {
            uvec2 entry = entries[start + pair.x];
            entries[start + pair.x] = entries[start + pair.y];
            entries[start + pair.y] = entry;
        }
    }
    memoryBarrierBuffer();
    barrier();
}

void sort_block(uint start, uint count) {
    load(start, count);
    for (uint stage = 1u; stage <= BLOCK_STAGES && 1u << (stage - 1u) < count; stage++) {
        order_own(count, 1u << (stage - 1u), true);
        for (uint step = 2u; step <= stage; step++)
            order_own(count, 1u << (stage - step), false);
    }
    store(start, count);
}

// The steps of a later stage that stay within a block.
void order_block(uint start, uint count) {
    load(start, count);
    for (uint step = 1u; step <= BLOCK_STAGES; step++)
        order_own(count, 1u << (BLOCK_STAGES - step), false);
    store(start, count);
}

void sort_list(uint start, uint count) {
    for (uint block = 0u; block < count; block += BLOCK)
        sort_block(start + block, min(count - block, BLOCK));
    for (uint stage = BLOCK_STAGES + 1u; stage <= 31u && 1u << (stage - 1u) < count; stage++) {
        order_in_place(start, count, 1u << (stage - 1u), true);
        for (uint step = 2u; step <= stage && stage - step >= BLOCK_STAGES; step++)
            order_in_place(start, count, 1u << (stage - step), false);
        for (uint block = 0u; block < count; block += BLOCK)
            order_block(start + block, min(count - block, BLOCK));
    }
}

void sort_tile(uint tile) {
    uvec2 list = list_of(tile);
    if (list.y <= GROUP)
        sort_by_counting(list.x, list.y);
    else
        sort_list(list.x, list.y);
}
