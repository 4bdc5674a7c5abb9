// Every ray starts before all crossings with an empty list, and ends where a kernel sphere bars it: there it is inside the
// fluid, so the surface is not behind. That does not hold where a ball of negative weight carves, nor for a ray that starts
// inside.
#include "methods/depth_peeling/state.glsl"

#if KERNEL_SPHERES
uniform sampler2D kernel_depth_tx;
#endif
#if WITH_STARTS
uniform sampler2D start_tx;
uniform float isovalue;
#endif

layout(location = 0) out uvec4 out_state;
layout(location = 1) out float out_barrier;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    State state = State(0u, 0u, PHASE_PEELING, false, BEFORE_ALL);
    float barrier = NO_BARRIER;
#if KERNEL_SPHERES
    barrier = texelFetch(kernel_depth_tx, pixel, 0).x;
#endif
#if WITH_STARTS
    vec2 start = texelFetch(start_tx, pixel, 0).xy;
    state.is_inside = start.x >= isovalue;
    if (state.is_inside || start.y > 0.0)
        barrier = NO_BARRIER;
#endif
    out_state = uvec4(state_pack(state), 0u, 0u);
    out_barrier = barrier;
    gl_FragDepth = barrier;
}
