// A square around the reach of each particle, up to four times where it crosses the edges of the folded image (section 7.3.3, second
// pass).
#include "lib/triangles.glsl"
#include "methods/surface_particles/state.glsl"
#include "methods/surface_particles/folded.glsl"
#include "methods/surface_particles/crowd.glsl"

uniform int level;

flat out int v_particle;
flat out vec4 v_place;
flat out vec3 v_normal;

const int SQUARES = 4, CORNERS = 6;

void main() {
    v_particle = gl_VertexID / (SQUARES * CORNERS);
    int copy = gl_VertexID / CORNERS % SQUARES;
    vec4 place = particle_place(v_particle);
    v_place = place;
    v_normal = particle_normal(v_particle).xyz;
    ivec2 middle = folded_pixel(place.xyz);
    // None of the level reaches farther; rounding may move a particle to the pixel beside its own.
    int span = int(min(reach * place.w, level_side(level)) / pixel_width) + 2;
    ivec2 low = folded(middle - span);
    low -= image_side * (ivec2(copy & 1, copy >> 1) * ivec2(greaterThan(low + 2 * span + 1, ivec2(image_side))));
    bool is_own = copy == 0 || any(lessThan(low, ivec2(0)));
    bool is_drawn = place.w > 0.0 && is_own && (copy != 3 || all(lessThan(low, ivec2(0))));
    vec2 corner = vec2(low) + float(2 * span + 1) * square_corner(gl_VertexID % CORNERS);
    gl_Position = is_drawn ? vec4(2.0 * corner / float(image_side) - 1.0, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
