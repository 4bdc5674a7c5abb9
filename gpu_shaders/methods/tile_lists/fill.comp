// Puts the seen balls into the lists of their tiles.
#define ENTRIES_ACCESS writeonly
#include "methods/tile_lists/occlusion.glsl"
#include "methods/tile_lists/tiles.glsl"
#include "methods/tile_lists/seen.glsl"
#include "methods/tile_lists/entries.glsl"

layout(local_size_x = THREADS) in;

layout(std430, binding = 8) readonly buffer SeenBalls {
    Seen seen[];
};
layout(std430, binding = 9) buffer TileEnds {
    uint tile_ends[]; // where the next entry of each tile goes
};

void main() {
    uint place = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * uint(THREADS) + gl_LocalInvocationIndex;
    if (place >= counts.seen_count || !lists_fit())
        return;
    Seen own = seen[place];
    ivec2 first = unpack_first(own.first), last = unpack_last(own.last);
    int level = unpack_level(own.last);
    for (int y = first.y; y <= min(last.y, LARGEST_SIDE); y++) {
        for (int x = first.x; x <= min(last.x, LARGEST_SIDE); x++) {
            if (tile_sees(level, ivec2(x, y), own.front)) {
                uint entry = atomicAdd(tile_ends[tile_number(level, ivec2(x, y))], 1u);
                entries[entry] = uvec2(distance_key(own.front), place);
            }
        }
    }
}
