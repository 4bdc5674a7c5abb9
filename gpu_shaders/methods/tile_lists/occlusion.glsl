// What kernel spheres hide: for each cell of CELL_SIZE pixels a distance at which all its rays have surely met the surface, and
// a pyramid over the cells in which each level has the greatest of four. Bits of floats that are not negative, which are ordered
// as they are; HIDES_NOTHING where nothing is known.

layout(std430, binding = 3) buffer Occlusion {
    uint occlusion[];
};

layout(std140, binding = 0) uniform Grid {
    ivec2 cells; // across and up, of the finest level
    int level_count;
    ivec4 level_starts[OCCLUSION_LEVELS]; // where each level lies, in x; where each level of tiles lies, in y, and its columns, in z
};

const uint HIDES_NOTHING = 0x7f800000u; // infinity
const int LARGEST_SIDE = 32768;

ivec2 level_size(int level) {
    return (cells + (1 << level) - 1) >> level;
}

int occlusion_index(int level, ivec2 cell) {
    return level_starts[level].x + cell.y * level_size(level).x + cell.x;
}

// The greatest distance at which a ray of the cells from `first` to `last` meets the surface.
float occlusion_farthest(ivec2 first, ivec2 last) {
    ivec2 span = last - first;
    int level = min(findMSB(max(max(span.x, span.y), 0)) + 1, level_count - 1);
    ivec2 low = first >> level, high = last >> level;
    uint farthest = max(occlusion[occlusion_index(level, low)], occlusion[occlusion_index(level, high)]);
    farthest = max(farthest, occlusion[occlusion_index(level, ivec2(low.x, high.y))]);
    farthest = max(farthest, occlusion[occlusion_index(level, ivec2(high.x, low.y))]);
    return uintBitsToFloat(farthest);
}
