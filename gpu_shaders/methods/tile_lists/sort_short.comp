// Sorts the short lists, a team of threads for each, by counting what comes before each entry.
#define ENTRIES_ACCESS
#include "methods/tile_lists/order.glsl"

layout(local_size_x = THREADS) in;

shared uvec2 own_entries[THREADS / TEAM * SHORT_LIST];

void main() {
    uint own = gl_LocalInvocationIndex;
    uint number = own % TEAM, first = own / TEAM * SHORT_LIST;
    uint tile = ((gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * uint(THREADS) + own) / TEAM;
    uvec2 list = tile < list_count && lists_fit() ? list_of(tile) : uvec2(0u);
    uint count = list.y <= SHORT_LIST ? list.y : 0u;
    for (uint i = number; i < count; i += TEAM)
        own_entries[first + i] = entries[list.x + i];
    memoryBarrierShared();
    barrier();
    for (uint i = number; i < count; i += TEAM) {
        uvec2 entry = own_entries[first + i];
        uint before = 0u;
        for (uint other = 0u; other < count; other++)
            before += uint(other != i && comes_before(own_entries[first + other], entry));
        entries[list.x + before] = entry;
    }
}
