// Adds what a particle does to the one that its pixel holds, by blending.
#include "methods/surface_particles/state.glsl"
#include "methods/surface_particles/crowd.glsl"

uniform usampler2D layer_tx;
uniform float reach;

flat in int v_particle;
flat in vec3 v_position;
flat in vec3 v_normal;
layout(location = 0) out vec4 out_pressure;
layout(location = 1) out float out_company;

void main() {
    int pushed = int(texelFetch(layer_tx, ivec2(gl_FragCoord.xy), 0).x) - 1;
    if (pushed < 0 || pushed == v_particle)
        discard;
    Pressure pressure = Pressure(vec3(0.0), 0.0, 0.0);
    vec3 offset = particle_place(pushed).xyz - v_position;
    pressure_add(pressure, offset, particle_normal(pushed).xyz, v_normal, reach, pushed);
    if (pressure.company == 0.0)
        discard;
    out_pressure = vec4(pressure.force, pressure.density);
    out_company = pressure.company;
}
