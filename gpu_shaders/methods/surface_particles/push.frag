// Adds what a particle does to the one that its pixel holds, by blending.
#include "methods/surface_particles/state.glsl"
#include "methods/surface_particles/crowd.glsl"

uniform usampler2D layer_tx;

flat in int v_particle;
flat in vec4 v_place;
flat in vec3 v_normal;
layout(location = 0) out vec4 out_pressure;
layout(location = 1) out float out_company;

void main() {
    int pushed = int(texelFetch(layer_tx, ivec2(gl_FragCoord.xy), 0).x) - 1;
    if (pushed < 0 || pushed == v_particle)
        discard;
    Pressure pressure = Pressure(vec3(0.0), 0.0, 0.0);
    vec4 place = particle_place(pushed);
    float h = reach * min(place.w, v_place.w);
    pressure_add(pressure, place.xyz - v_place.xyz, particle_normal(pushed).xyz, v_normal, h, pushed);
    if (pressure.company == 0.0)
        discard;
    out_pressure = vec4(pressure.force, pressure.density);
    out_company = pressure.company;
}
