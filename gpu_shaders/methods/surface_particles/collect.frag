// Gives the particles of a layer the pressure at their pixels.
#include "methods/surface_particles/state.glsl"
#include "methods/surface_particles/folded.glsl"

uniform usampler2D layer_tx;
uniform sampler2D pushed_tx;     // force, density
uniform sampler2D companions_tx; // how many others are within reach

layout(location = 0) out vec4 out_pressure;
layout(location = 1) out float out_company;

void main() {
    int particle = particle_of_fragment(gl_FragCoord.xy);
    if (particle >= particle_count)
        discard;
    ivec2 pixel = folded(folded_pixel(particle_place(particle).xyz));
    if (texelFetch(layer_tx, pixel, 0).x != uint(particle) + 1u)
        discard;
    out_pressure = texelFetch(pushed_tx, pixel, 0);
    out_company = texelFetch(companions_tx, pixel, 0).x;
}
