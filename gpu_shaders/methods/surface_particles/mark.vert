// Brings each particle of a level to its pixel, unless an earlier layer has it (section 7.3.3, first pass). A layer keeps the lowest number at
// each pixel; the next one keeps what is above that.
#include "methods/surface_particles/state.glsl"
#include "methods/surface_particles/folded.glsl"
#include "methods/surface_particles/crowd.glsl"

uniform usampler2D layer_tx; // the numbers of the layer before, 0 for none
uniform bool is_first;
uniform int level;

flat out uint v_number;

void main() {
    vec4 place = particle_place(gl_VertexID);
    ivec2 pixel = folded(folded_pixel(place.xyz));
    v_number = uint(gl_VertexID) + 1u;
    uint before = is_first ? 0u : texelFetch(layer_tx, pixel, 0).x;
    bool is_new = place.w > 0.0 && level_of(reach * place.w) == level && (is_first || (before > 0u && v_number > before));
    // All numbers below 2^24 have depths of their own.
    float depth = float(v_number) / 8388608.0 - 1.0;
    vec2 position = (2.0 * vec2(pixel) + 1.0) / float(image_side) - 1.0;
    gl_Position = is_new ? vec4(position, depth, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = 1.0;
}
