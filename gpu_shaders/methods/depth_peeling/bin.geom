// A pair for each cell that a ball meets and that asks for it.
#include "methods/depth_peeling/cells.glsl"

layout(points) in;
layout(points, max_vertices = 16) out;

flat in uint v_id[1];
flat in uint v_level[1];
flat in ivec4 v_cells[1];
flat in vec2 v_reach[1];

flat out uvec2 out_pair;

void main() {
    for (int row = 0; row < CELLS_ACROSS; row++) {
        for (int column = 0; column < CELLS_ACROSS; column++) {
            ivec2 cell = v_cells[0].xy + ivec2(column, row);
            if (all(lessThanEqual(cell, v_cells[0].zw)) && cell_wants(v_level[0], cell, v_reach[0].x, v_reach[0].y)) {
                out_pair = uvec2(v_id[0], cell_number(v_level[0], cell));
                EmitVertex();
                EndPrimitive();
            }
        }
    }
}
