// What each particle draws: a disc that bends as the surface does where it is (section 7.6).
#include "methods/surface_particles/state.glsl"
#include "methods/surface_particles/fluid.glsl"

uniform sampler2D company_tx; // how many others are within reach
uniform float reach;          // influence radii

// A disc's radius in distances of the even spread that there is around it, and in reaches at least: what fills gaps lets none be wider.
const float DISC_SPACINGS = 1.2;
const float DISC_LEAST = 0.65;
const float TAU = 6.28318530718;

layout(location = 0) out vec4 out_bend_along;  // xx, yy, zz; the disc's radius
layout(location = 1) out vec4 out_bend_across; // xy, xz, yz

// The second derivatives of F at a point.
mat3 second_derivatives(vec3 point) {
    mat3 sum = mat3(0.0);
    int count = hash_levels();
    for (int level = 0; level < count; level++) {
        Bucket bucket = hash_find(level, point);
        for (uint i = 0u; i < bucket.count; i++) {
            int ball = hash_ball(bucket, i);
            if (ball < 0)
                continue;
            vec4 sphere = hash_sphere(ball);
            vec3 offset = (point - sphere.xyz) / sphere.w;
            float x = 1.0 - dot(offset, offset);
            float weight = texelFetch(motion_tx, hash_texel(uint(ball)), 0).w / (sphere.w * sphere.w);
            sum += weight * (4.0 * kernel_second_derivative(x) * outerProduct(offset, offset) - 2.0 * kernel_derivative(x) * mat3(1.0));
        }
    }
    return sum;
}

// A such that near the point the surface is n . x + x A x / 2 = 0: how the normal changes along the surface, and along the normal the
// mean of that, which is right for spheres.
mat3 bend_at(vec3 point, vec3 normal) {
    float slope = length(fluid_sample(point).gradient);
    mat3 along_surface = mat3(1.0) - outerProduct(normal, normal);
    mat3 bend = along_surface * second_derivatives(point) * along_surface * (-1.0 / slope);
    float mean = (bend[0][0] + bend[1][1] + bend[2][2]) / 2.0;
    return slope > 0.0 ? bend + mean * outerProduct(normal, normal) : mat3(0.0);
}

void main() {
    int particle = particle_of_fragment(gl_FragCoord.xy);
    if (particle >= particle_count)
        discard;
    mat3 bend = bend_at(particle_place(particle).xyz, particle_normal(particle).xyz);
    float own_reach = reach * particle_place(particle).w;
    float company = texelFetch(company_tx, particle_texel(particle), 0).x;
    // Of the hexagonal lattice that has so many points within the reach.
    float spacing = own_reach * sqrt(TAU / (sqrt(3.0) * (company + 1.0)));
    out_bend_along = vec4(bend[0][0], bend[1][1], bend[2][2], max(DISC_SPACINGS * spacing, DISC_LEAST * own_reach));
    out_bend_across = vec4(bend[0][1], bend[0][2], bend[1][2], 0.0);
}
