// Cells: squares of the image, in levels: of CELL_SIZE pixels, of CELL_FACTOR times that, and once more; the last level's only
// cell is the whole image. For each level a texture holds the range of scaled distances that its pixels ask for; where none asks
// for anything it is empty.
#include "lib/range.glsl"

uniform sampler2D cells_0_tx;
uniform sampler2D cells_1_tx;
uniform sampler2D cells_2_tx;
uniform sampler2D cells_3_tx;

const uint WHOLE_IMAGE = 3u;

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

// The cells of a level that a rectangle of pixels lies in: low corner, high corner; inclusive.
ivec4 cells_around(vec4 rectangle, uint level) {
    // The last pixel of a rectangle that ends on a cell's edge is in the cell before.
    return ivec4(vec4(rectangle.xy, max(ceil(rectangle.zw) - 1.0, rectangle.xy)) / cell_size(level));
}
