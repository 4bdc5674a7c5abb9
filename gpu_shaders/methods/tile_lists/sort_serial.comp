// Sorts the short lists, a thread for each (Shell 1959).
#define ENTRIES_ACCESS
#include "methods/tile_lists/order.glsl"

layout(local_size_x = THREADS) in;

// Every `gap`th entry becomes sorted.
void sort_with_gap(uint start, uint count, uint gap) {
    for (uint i = gap; i < count; i++) {
        uvec2 entry = entries[start + i];
        uint place = i;
        for (uint step = 0u; step < SHORT_LIST && place >= gap; step++) {
            uvec2 before = entries[start + place - gap];
            if (!comes_before(entry, before))
                break;
            entries[start + place] = before;
            place -= gap;
        }
        entries[start + place] = entry;
    }
}

void main() {
    uint tile = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * uint(THREADS) + gl_LocalInvocationIndex;
    if (tile >= list_count || !lists_fit())
        return;
    uvec2 list = list_of(tile);
    if (list.y > SHORT_LIST)
        return;
    const uint gaps[6] = uint[6](132u, 57u, 23u, 10u, 4u, 1u); // Ciura 2001
    for (int i = 0; i < 6; i++)
        if (gaps[i] < list.y)
            sort_with_gap(list.x, list.y, gaps[i]);
}
