// Cells: squares of the image, in levels: of CELL_SIZE pixels, of CELL_FACTOR times that, and once more; the last level's only
// cell is the whole image. For each level a texture holds the range of distances that its pixels still ask for: from the least
// distance that one has reached to the greatest that one wants to reach. Where none asks for anything it is empty.
// A cell's number: level (2 bits), y (15 bits), x (15 bits).
#include "methods/depth_peeling/range.glsl"

uniform sampler2D cells_0_tx;
uniform sampler2D cells_1_tx;
uniform sampler2D cells_2_tx;
uniform sampler2D cells_3_tx;

const uint WHOLE_IMAGE = 3u;
const int CELLS_ACROSS = 4; // at most, of one ball

uint cell_number(uint level, ivec2 cell) {
    return level << 30u | uint(cell.y) << 15u | uint(cell.x);
}

uint cell_level(uint number) {
    return number >> 30u;
}

ivec2 cell_position(uint number) {
    return ivec2(number & 0x7fffu, (number >> 15u) & 0x7fffu);
}

float cell_size(uint level) {
    return level == 0u   ? float(CELL_SIZE)
           : level == 1u ? float(CELL_SIZE * CELL_FACTOR)
           : level == 2u ? float(CELL_SIZE * CELL_FACTOR * CELL_FACTOR)
                         : 32768.0;
}

vec2 cell_range(uint level, ivec2 cell) {
    return level == 0u   ? texelFetch(cells_0_tx, cell, 0).xy
           : level == 1u ? texelFetch(cells_1_tx, cell, 0).xy
           : level == 2u ? texelFetch(cells_2_tx, cell, 0).xy
                         : texelFetch(cells_3_tx, cell, 0).xy;
}

// Whether a cell asks for anything between two scaled distances.
bool cell_wants(uint level, ivec2 cell, float nearest, float farthest) {
    vec2 range = cell_range(level, cell);
    bool wants = !range_is_empty(range) && range.x <= farthest;
#if BALL_CULLING
    wants = wants && nearest <= range.y;
#endif
    return wants;
}
