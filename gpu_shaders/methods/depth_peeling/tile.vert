// Two triangles for each fine cell, as a strip; those in which no pixel asks for anything fall together.
#include "methods/depth_peeling/cells.glsl"

uniform ivec2 image_size;
uniform int cells_across; // of the image

void main() {
    ivec2 cell = ivec2(gl_InstanceID % cells_across, gl_InstanceID / cells_across);
    vec2 range = cell_range(0u, cell);
    vec2 corner = range.x <= range.y ? vec2(gl_VertexID & 1, gl_VertexID >> 1) : vec2(0.0);
    vec2 position = (vec2(cell) + corner) * cell_size(0u) / vec2(image_size);
    gl_Position = vec4(min(2.0 * position - 1.0, 1.0), 0.0, 1.0);
}
