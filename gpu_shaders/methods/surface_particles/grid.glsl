// Particles in cells as wide as their reach; cells share buckets.
#include "lib/random.glsl"
#include "methods/surface_particles/state.glsl"

layout(local_size_x = THREADS) in;
layout(std430, binding = 0) buffer Counts { uint total; uint pad[3]; };
layout(std430, binding = 1) buffer Buckets { uvec2 buckets[]; }; // where its members begin, and how many there are
layout(std430, binding = 2) buffer Members { uint members[]; };

uniform float reach;
uniform int bucket_count; // a power of two

ivec3 grid_cell(vec3 position) {
    return ivec3(clamp(floor(position / reach), -1073741824.0, 1073741824.0));
}

uint grid_bucket(ivec3 cell) {
    uvec3 bits = uvec3(cell);
    return random_mixed(random_mixed(random_mixed(bits.x) ^ bits.y) ^ bits.z) & uint(bucket_count - 1);
}

// The number of this thread, of groups in lines.
int grid_thread() {
    return int((gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x) * uint(THREADS) + gl_LocalInvocationID.x);
}
