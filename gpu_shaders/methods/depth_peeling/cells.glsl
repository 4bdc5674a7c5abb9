// What the cells of the image (lib/cells.glsl) ask for: from the least distance that a pixel has reached to the greatest that one
// wants to reach.
// A cell's number: level (2 bits), y (15 bits), x (15 bits).
#include "lib/cells.glsl"

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

// Whether a cell asks for anything between two scaled distances.
bool cell_wants(uint level, ivec2 cell, float nearest, float farthest) {
    vec2 range = cell_range(level, cell);
    bool wants = !range_is_empty(range) && range.x <= farthest;
#if BALL_CULLING
    wants = wants && nearest <= range.y;
#endif
    return wants;
}
