// Two triangles for each of the smallest cells; where no pixel asks for anything they fall together.
#include "lib/triangles.glsl"
#include "methods/depth_peeling/cells.glsl"

uniform ivec2 image_size;
uniform int cells_across; // of the image

void main() {
    int index = gl_VertexID / 6;
    ivec2 cell = ivec2(index % cells_across, index / cells_across);
    vec2 range = cell_range(0u, cell);
    vec2 corner = range_is_empty(range) ? vec2(0.0) : square_corner(gl_VertexID % 6);
    vec2 position = (vec2(cell) + corner) * cell_size(0u) / vec2(image_size);
    gl_Position = vec4(min(2.0 * position - 1.0, 1.0), 0.0, 1.0);
}
