// Particles in the cells of their levels; cells share buckets.
#include "methods/surface_particles/state.glsl"
#include "methods/surface_particles/crowd.glsl"

layout(local_size_x = THREADS) in;
layout(std430, binding = 0) buffer Counts { uint total; uint pad[3]; };
layout(std430, binding = 1) buffer Buckets { uvec2 buckets[]; }; // where its members begin, and how many there are
layout(std430, binding = 2) buffer Members { uint members[]; };

uniform int bucket_count; // a power of two

ivec3 grid_cell(vec3 position, int level) {
    return ivec3(clamp(floor(position / level_side(level)), -1073741824.0, 1073741824.0));
}

uint grid_bucket(ivec3 cell, int level) {
    uvec3 bits = uvec3(cell);
    uint mixed_bits = random_mixed(random_mixed(random_mixed(bits.x) ^ bits.y) ^ bits.z);
    return mixed_bits + uint(level) * 0x9e3779b9u & uint(bucket_count - 1);
}

// The bucket of a particle at a place.
uint grid_bucket_of(vec4 place) {
    int level = level_of(reach * place.w);
    return grid_bucket(grid_cell(place.xyz, level), level);
}

// The number of this thread, of groups in lines.
int grid_thread() {
    return int((gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x) * uint(THREADS) + gl_LocalInvocationID.x);
}
