// Sorts the lists that are even longer, a large group of threads for each.
#include "methods/tile_lists/group_sort.glsl"

layout(local_size_x = SORT_THREADS) in;

void main() {
    uint number = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (number < counts.longest_count && lists_fit())
        sort_tile(tile_starts[2u * list_count - 1u - number]);
}
