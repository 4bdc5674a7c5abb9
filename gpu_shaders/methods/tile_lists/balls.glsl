// The balls as they lie in memory, in world space.
#include "lib/chord.glsl"

layout(std430, binding = 0) readonly buffer Positions {
    float positions[]; // three a ball
};
layout(std430, binding = 1) readonly buffer Radii {
    float radii[];
};
#if WITH_WEIGHTS
layout(std430, binding = 2) readonly buffer Weights {
    float weights[];
};
#else
uniform float weight_of_all;
#endif

uniform uint ball_count;
uniform dvec3 eye;
uniform dmat3 view_from_world;

// The number of a thread, also where there are more groups of threads than fit in a line.
uint thread_number() {
    return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * uint(THREADS) + gl_LocalInvocationIndex;
}

// In double precision: only the subtraction of the eye makes coordinates small.
Ball ball_in_view(uint id) {
    dvec3 offset = dvec3(positions[3u * id], positions[3u * id + 1u], positions[3u * id + 2u]) - eye;
    return Ball(vec3(view_from_world * offset), radii[id]);
}

float ball_weight(uint id) {
#if WITH_WEIGHTS
    return weights[id];
#else
    return weight_of_all;
#endif
}
