// The order of the lists: by where the balls begin, then by their ids. So it, and each sum, is the same in every run.
#include "methods/tile_lists/seen.glsl"
#include "methods/tile_lists/entries.glsl"

layout(std430, binding = 8) readonly buffer SeenBalls {
    Seen seen[];
};
layout(std430, binding = 9) readonly buffer TileEnds {
    uint tile_ends[];
};
layout(std430, binding = 10) readonly buffer TileStarts {
    uint tile_starts[]; // then the tiles with long lists, see allot.comp
};

uniform uint list_count;

bool comes_before(uvec2 one, uvec2 other) {
    return one.x < other.x || (one.x == other.x && seen[one.y].id < seen[other.y].id);
}

// Where a tile's list begins, and its length.
uvec2 list_of(uint tile) {
    return uvec2(tile_starts[tile], tile_ends[tile] - tile_starts[tile]);
}
