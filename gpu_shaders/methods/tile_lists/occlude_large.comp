// Draws the kernel spheres that cover many cells, a group of threads for each.
#include "methods/tile_lists/kernel_sphere.glsl"
#include "methods/tile_lists/large.glsl"

layout(local_size_x = THREADS) in;

void main() {
    Occluder occluder = occluder_of(large_balls[gl_WorkGroupID.x]);
    int cell_count = occluder_cells(occluder);
    int width = occluder.end.x - occluder.first.x;
    int own = int(gl_LocalInvocationIndex);
    for (int first = 0; first < cell_count; first += THREADS) {
        int cell = first + own;
        if (cell < cell_count)
            draw_cell(occluder, occluder.first + ivec2(cell % width, cell / width));
    }
}
