// Tiles: squares of the image, in three levels of 8, 64 and 512 pixels; they are the cells of three levels of the pyramid. A ball
// is in the lists of the tiles that it may be seen in, on the finest level on which these are not too many.

const int TILE_LEVELS = 3;
const int MOST_TILES_ACROSS = 9; // of a ball, except on the coarsest level

int tile_occlusion_level(int level) {
    return min(1 + 3 * level, level_count - 1);
}

ivec2 tile_grid(int level) {
    return level_size(1 + 3 * level);
}

int tile_number(int level, ivec2 tile) {
    return level_starts[level].y + tile.y * tile_grid(level).x + tile.x;
}

// Whether rays of a tile may meet something that begins at a distance.
bool tile_sees(int level, ivec2 tile, float front) {
    int occlusion_level = tile_occlusion_level(level);
    ivec2 cell = min(tile, level_size(occlusion_level) - 1);
    return front < uintBitsToFloat(occlusion[occlusion_index(occlusion_level, cell)]);
}
