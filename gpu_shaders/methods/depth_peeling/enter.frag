// After the first peel: a ray that meets no ball is done, the others have entered their first ball; there is nothing to search
// before it. Both of a pixel's states are written, so that cells without balls are left out from now on.
#include "methods/depth_peeling/state.glsl"

uniform usampler2D state_tx;
uniform usampler2D crossing_tx;
uniform sampler2D depth_tx;
uniform sampler2D barrier_tx;

layout(location = 0) out uvec4 out_state;
layout(location = 1) out uvec4 out_older_state;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    State state = state_unpack(texelFetch(state_tx, pixel, 0).xy);
    float depth = texelFetch(depth_tx, pixel, 0).x;
    float barrier = texelFetch(barrier_tx, pixel, 0).x;
    uint crossing = texelFetch(crossing_tx, pixel, 0).x;
    if (depth < barrier)
        state = State(crossing, 1u, PHASE_PEELING, state.is_inside, depth);
    else
        state = state_done(state, barrier < NO_BARRIER ? barrier : NO_SURFACE);
    out_state = uvec4(state_pack(state), crossing - 1u, 0u);
    out_older_state = out_state;
    gl_FragDepth = state.phase == PHASE_PEELING ? barrier : 0.0;
}
