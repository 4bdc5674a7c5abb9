// A step of repulsion (section 7.3) and of dispersion (section 7.4). The same as native/core/src/surface_particles/mod.rs.
#include "lib/random.glsl"
#include "methods/surface_particles/state.glsl"
#include "methods/surface_particles/fluid.glsl"
#include "methods/surface_particles/motion.glsl"

uniform sampler2D pressure_tx; // force, density
uniform float reach;           // how far particles push one another, in influence radii
uniform float push;            // how far pressure moves a particle, in reaches
uniform uint seed;
uniform uint step_number;
uniform bool disperses;

// One of so many particles may change its place in a step, for one whose density is less by more than the threshold.
const uint DISPERSING = 8u;
const float DISPERSION_THRESHOLD = 0.5;

layout(location = 0) out vec4 out_place;
layout(location = 1) out vec4 out_normal;

// Of a particle in this step.
uint own_seed(int particle) {
    return random_branch(random_branch(seed, step_number), uint(particle));
}

// A place of the surface where a particle has less company, if it should go there in this step; else -1.
int thinner(int particle) {
    uint number = own_seed(particle);
    if (!disperses || number % DISPERSING != 0u)
        return -1;
    int other = int(random_mixed(number) % uint(particle_count));
    float own = texelFetch(pressure_tx, particle_texel(particle), 0).w;
    bool is_thinner = own - texelFetch(pressure_tx, particle_texel(other), 0).w > DISPERSION_THRESHOLD;
    return is_thinner && particle_place(other).w > 0.0 ? other : -1;
}

// On the rim of another particle's influence, where it changes nothing (equation 10).
vec3 rim_of(int other, int particle) {
    vec3 normal = particle_normal(other).xyz;
    vec3 direction = random_direction(own_seed(particle));
    vec3 tangent = direction - dot(direction, normal) * normal;
    float span = length(tangent);
    vec4 place = particle_place(other);
    return place.xyz + reach * place.w * (span > 0.0 ? tangent / span : tangent);
}

// Where others push it in a step in time that is as long as its feedback (equations 2 and 8).
vec3 pushed(int particle, vec4 place) {
    Sample found = fluid_sample(place.xyz);
    float own_reach = reach * place.w;
    vec3 desired = motion_within(push * own_reach * texelFetch(pressure_tx, particle_texel(particle), 0).xyz, own_reach);
    return place.xyz + motion_within(fluid_constrained(found, desired, 0.0, 1.0), found.scale);
}

void main() {
    int particle = particle_of_fragment(gl_FragCoord.xy);
    if (particle >= particle_count)
        discard;
    vec4 place = particle_place(particle), normal = particle_normal(particle);
    SurfacePoint point = SurfacePoint(false, place.xyz, vec3(0.0), 0.0);
    float dispersed = normal.w;
    int other = thinner(particle);
    if (other >= 0) {
        point = fluid_projected(rim_of(other, particle));
        dispersed += point.is_there ? 1.0 : 0.0;
    }
    if (!point.is_there)
        point = fluid_projected(pushed(particle, place));
    out_place = vec4(point.position, point.is_there && place.w > 0.0 ? point.scale : 0.0);
    out_normal = vec4(point.normal, dispersed);
}
