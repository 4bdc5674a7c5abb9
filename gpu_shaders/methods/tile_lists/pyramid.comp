// Makes four levels of the pyramid from the one before: each group of threads has 16 x 16 cells of that.
#include "methods/tile_lists/occlusion.glsl"

layout(local_size_x = 256) in;

layout(std430, binding = 5) readonly buffer OpenCells {
    uint open_cells[];
};

uniform int base_level;

shared uint values[256];

uint base_value(ivec2 cell) {
    if (any(greaterThanEqual(cell, level_size(base_level))))
        return 0u;
    int index = occlusion_index(base_level, cell);
    if (base_level == 0 && open_cells[cell.y * cells.x + cell.x] != 0u)
        occlusion[index] = HIDES_NOTHING;
    return occlusion[index];
}

void main() {
    uint own = gl_LocalInvocationIndex;
    ivec2 place = ivec2(own % 16u, own / 16u);
    ivec2 cell = ivec2(gl_WorkGroupID.xy) * 16 + place;
    values[own] = base_value(cell);
    for (int up = 1; up <= 4; up++) {
        memoryBarrierShared();
        barrier();
        uint side = 1u << uint(up - 1);
        ivec2 above = cell >> up;
        int level = base_level + up;
        if ((place.x & ((1 << up) - 1)) == 0 && (place.y & ((1 << up) - 1)) == 0) {
            values[own] = max(max(values[own], values[own + side]), max(values[own + 16u * side], values[own + 17u * side]));
            if (level < level_count && all(lessThan(above, level_size(level))))
                occlusion[occlusion_index(level, above)] = values[own];
        }
    }
}
