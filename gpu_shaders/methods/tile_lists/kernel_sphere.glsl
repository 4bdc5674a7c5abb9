// Kernel spheres in the cells of the image (Kanamori et al. 2008, section 5.2, by cells instead of pixels).
#include "lib/sphere_bounds.glsl"
#include "methods/tile_lists/balls.glsl"
#include "methods/tile_lists/occlusion.glsl"

// Least kernel radius, as a share of the influence radius, of the weights for which isovalue / weight is in each part of 0 to 1.
layout(std430, binding = 4) readonly buffer KernelShares {
    float kernel_shares[];
};
// Cells in which nothing may be hidden.
layout(std430, binding = 5) buffer OpenCells {
    uint open_cells[];
};

uniform float isovalue;
uniform vec2 clip_distances; // planar
uniform vec2 slab;           // rays are searched between these distances

// What a ball does to the cells from `first` to before `end`: its kernel sphere hides what is behind, or it opens them, because
// it carves or a ray may start in the fluid.
struct Occluder {
    bool opens;
    ivec2 first;
    ivec2 end;
    vec2 middle;    // of the sphere, pixels
    vec2 pixel;     // its size at the sphere's depth
    float distance; // of the centre
    float radius;
};

float kernel_radius(float weight, float radius) {
    if (weight <= 0.0)
        return 0.0;
    int part = int(min(floor(isovalue / weight * float(KERNEL_SHARES)), float(KERNEL_SHARES)));
    return radius * kernel_shares[part];
}

Occluder opener(Ball ball) {
    vec4 rectangle = sphere_rectangle(ball.center, ball.radius);
    ivec2 first = ivec2(rectangle.xy) / CELL_SIZE;
    ivec2 end = min(ivec2(rectangle.zw) / CELL_SIZE + 1, cells);
    bool is_seen = ball.radius - ball.center.z > clip_distances.x && all(lessThan(rectangle.xy, rectangle.zw));
    return Occluder(true, first, is_seen ? end : first, vec2(0.0), vec2(0.0), 0.0, 0.0);
}

// Nothing where the sphere covers no pixels of a cell or reaches before the clip distance.
Occluder hider(Ball ball, float weight) {
    float radius = kernel_radius(weight, ball.radius);
    float depth = -ball.center.z;
    // Blender units for each unit of the window.
    float unit = is_perspective ? depth : 1.0;
    float half_diagonal = 0.5 * float(CELL_SIZE - 1) * length(pixel_size) * unit;
    if (radius <= half_diagonal || depth - radius <= clip_distances.x)
        return Occluder(false, ivec2(0), ivec2(0), vec2(0.0), vec2(0.0), 0.0, 0.0);
    vec2 pixel = unit * pixel_size;
    vec2 middle = (ball.center.xy / unit - window_middle) / pixel_size + image_middle;
    vec2 reach = radius / pixel;
    vec2 first = floor((middle - reach - 0.5) / float(CELL_SIZE) + 1.0);
    vec2 end = floor((middle + reach + 0.5) / float(CELL_SIZE));
    float to_center = is_perspective ? length(ball.center) : depth;
    return Occluder(false, ivec2(clamp(first, vec2(0.0), vec2(cells))), ivec2(clamp(end, vec2(0.0), vec2(cells))), middle, pixel,
                    to_center * (1.0 + DISTANCE_ERROR), radius);
}

Occluder occluder_of(uint id) {
    Ball ball = ball_in_view(id);
    float weight = ball_weight(id);
    bool opens = weight < 0.0 || -ball.center.z - ball.radius <= clip_distances.x * (1.0 + DISTANCE_ERROR) ||
                 sphere_nearest(ball.center, ball.radius) <= slab.x;
    // A ball that begins before the clip distance may still hide what is behind it elsewhere, but not where it is.
    if (opens)
        return opener(ball);
    return hider(ball, weight);
}

int occluder_cells(Occluder occluder) {
    ivec2 size = max(occluder.end - occluder.first, 0);
    return size.x * size.y;
}

// A ray that passes the centre at the distance p meets the sphere at tc - sqrt(r^2 - p^2), and tc <= |c|. In the plane of the
// centre's depth a pixel is at least p away from the centre.
void draw_cell(Occluder occluder, ivec2 cell) {
    if (occluder.opens) {
        open_cells[cell.y * cells.x + cell.x] = 1u;
        return;
    }
    vec2 to_middle = vec2(cell * CELL_SIZE) + 0.5 * float(CELL_SIZE) - occluder.middle;
    vec2 farthest = (abs(to_middle) + 0.5 * float(CELL_SIZE - 1)) * occluder.pixel;
    float half_chord_2 = occluder.radius * occluder.radius - dot(farthest, farthest);
    if (half_chord_2 <= 0.0)
        return;
    uint distance = floatBitsToUint(max(occluder.distance - sqrt(half_chord_2), 0.0));
    int index = occlusion_index(0, cell);
    // To read first spares the costly write where another sphere is nearer.
    if (distance < occlusion[index])
        atomicMin(occlusion[index], distance);
}
