// Tiles: squares of the image, in levels of 2, 8, 64 and 512 pixels. A ball is in the lists of the tiles that it may be seen in, on
// the finest level on which these are not too many.

const int TILE_LEVELS = 4;
const int TILE_SHIFTS[TILE_LEVELS] = int[TILE_LEVELS](1, 3, 6, 9); // powers of two, pixels
const int MOST_ACROSS[TILE_LEVELS - 1] = int[TILE_LEVELS - 1](FINEST_SPAN, 72, 576); // pixels of a ball, except on the coarsest level

int tile_number(int level, ivec2 tile) {
    return level_starts[level].y + tile.y * level_starts[level].z + tile.x;
}

// The level of a ball that covers so many pixels across.
int tile_level(int across) {
    return across <= MOST_ACROSS[0] ? 0 : across <= MOST_ACROSS[1] ? 1 : across <= MOST_ACROSS[2] ? 2 : 3;
}

// Whether rays of a tile may meet something that begins at a distance.
bool tile_sees(int level, ivec2 tile, float front) {
    ivec2 cell = (tile << TILE_SHIFTS[level]) / CELL_SIZE;
    int occlusion_level = min(max((TILE_SHIFTS[level] - CELL_SHIFT), 0), level_count - 1);
    int index = occlusion_index(occlusion_level, min(cell >> occlusion_level, level_size(occlusion_level) - 1));
    return front < uintBitsToFloat(occlusion[index]);
}
