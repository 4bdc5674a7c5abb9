// Moves the particles onto the surface; those for which that fails are lost.
#include "methods/surface_particles/state.glsl"
#include "methods/surface_particles/fluid.glsl"

layout(location = 0) out vec4 out_place;
layout(location = 1) out vec4 out_normal;

void main() {
    int particle = particle_of_fragment(gl_FragCoord.xy);
    if (particle >= particle_count)
        discard;
    vec4 place = particle_place(particle);
    SurfacePoint point = fluid_projected(place.xyz);
    bool is_there = point.is_there && place.w > 0.0;
    out_place = vec4(point.position, is_there ? point.scale : 0.0);
    out_normal = vec4(point.normal, 0.0);
}
