// The pressure on each particle (section 7.3.1), of the 27 cells around it on each level.
#include "methods/surface_particles/grid.glsl"

layout(rgba32f, binding = 0) writeonly uniform image2D pressure_image; // force, density
layout(r32f, binding = 1) writeonly uniform image2D company_image;     // how many others are within reach

void add_cell(inout Pressure pressure, ivec3 cell, int level, int particle, vec4 place, vec3 normal) {
    uvec2 bucket = buckets[grid_bucket(cell, level)];
    uint count = min(bucket.y, MOST_MEMBERS);
    for (uint i = 0u; i < count; i++) {
        int member = int(members[bucket.x + i]);
        vec4 other = particle_place(member);
        // Those of other cells come with their own.
        if (member == particle || level_of(reach * other.w) != level || grid_cell(other.xyz, level) != cell)
            continue;
        float h = reach * min(place.w, other.w);
        pressure_add(pressure, place.xyz - other.xyz, normal, particle_normal(member).xyz, h, particle);
    }
}

void main() {
    int particle = grid_thread();
    if (particle >= particle_count)
        return;
    vec4 place = particle_place(particle);
    Pressure pressure = Pressure(vec3(0.0), 0.0, 0.0);
    if (place.w > 0.0) {
        vec3 normal = particle_normal(particle).xyz;
        int count = min(level_count, MOST_LEVELS);
        for (int level = 0; level < count; level++) {
            ivec3 middle = grid_cell(place.xyz, level);
            for (int i = 0; i < 27; i++)
                add_cell(pressure, middle + ivec3(i / 9, i / 3 % 3, i % 3) - 1, level, particle, place, normal);
        }
    }
    imageStore(pressure_image, particle_texel(particle), vec4(pressure.force, pressure.density));
    imageStore(company_image, particle_texel(particle), vec4(pressure.company));
}
