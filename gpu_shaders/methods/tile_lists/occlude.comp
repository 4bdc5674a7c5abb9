// Draws kernel spheres into the cells, a thread for each; those that cover many cells are left to whole groups of threads. The
// cells are the same in any order: each has the least distance of all spheres.
#include "methods/tile_lists/kernel_sphere.glsl"
#include "methods/tile_lists/large.glsl"
#include "methods/tile_lists/seen.glsl"

layout(local_size_x = THREADS) in;

layout(std430, binding = 8) readonly buffer SeenBalls {
    Seen seen[]; // in the frame before
};

uniform bool is_first;    // some balls are drawn, while nothing is known yet
uniform uint drawn_count; // so many
uniform uint step_size;   // one of so many balls is drawn; 0: those that were seen in the frame before

const int FEW_CELLS = 64;

// Whether others hide the sphere in all of its cells, so that drawing changes nothing.
bool is_hidden(Occluder occluder) {
    return !is_first && !occluder.opens &&
           occluder.distance - occluder.radius >= occlusion_farthest(occluder.first, occluder.end - 1);
}

void main() {
    uint number = thread_number();
    if (number == 0u)
        large_groups[1] = large_groups[2] = 1u;
    if (number >= drawn_count)
        return;
    uint id = step_size == 0u ? min(seen[number].id, ball_count - 1u) : number * step_size;
    Occluder occluder = occluder_of(id);
    int cell_count = occluder_cells(occluder);
    if (cell_count == 0 || is_hidden(occluder))
        return;
    if (cell_count > FEW_CELLS) {
        uint place = atomicAdd(large_count, 1u);
        if (place < uint(LARGE_OCCLUDERS)) {
            large_balls[place] = id;
            atomicMax(large_groups[0], place + 1u);
            return;
        }
    }
    int width = occluder.end.x - occluder.first.x;
    for (int cell = 0; cell < cell_count; cell++)
        draw_cell(occluder, occluder.first + ivec2(cell % width, cell / width));
}
