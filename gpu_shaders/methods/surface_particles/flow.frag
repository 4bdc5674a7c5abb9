// Moves the particles with the balls of the frame before (equations 2 and 3): with those around it a particle goes as far as these;
// only what keeps it on a surface that changes its shape is bounded.
#include "methods/surface_particles/state.glsl"
#include "methods/surface_particles/fluid.glsl"
#include "methods/surface_particles/motion.glsl"

uniform float seconds;
uniform vec3 anchor_shift; // from the anchor of the next frame to that of the frame before

layout(location = 0) out vec4 out_place;

void main() {
    int particle = particle_of_fragment(gl_FragCoord.xy);
    if (particle >= particle_count)
        discard;
    vec4 place = particle_place(particle);
    Sample found = fluid_sample(place.xyz);
    vec3 correction = (fluid_constrained(found, found.velocity, found.rate, 0.0) - found.velocity) * seconds;
    out_place = vec4(place.xyz + seconds * found.velocity + motion_within(correction, found.scale) + anchor_shift, place.w);
}
