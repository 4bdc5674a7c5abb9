// Every ray starts before all crossings with an empty list. AGAIN: only those whose list overflowed, the others keep their
// surface.
#include "methods/depth_peeling/state.glsl"

#ifdef AGAIN
uniform usampler2D state_tx;
#endif

layout(location = 0) out uvec4 out_state;

void main() {
    State state = State(0u, 0u, STATE_FRESH, BEFORE_ALL);
#ifdef AGAIN
    State before = state_unpack(texelFetch(state_tx, ivec2(gl_FragCoord.xy), 0).xy);
    if (before.state != STATE_OVERFLOW)
        state = State(0u, 0u, STATE_DONE, before.state == STATE_DONE ? before.depth : NO_SURFACE);
#endif
    out_state = uvec4(state_pack(state), 0u, 0u);
    // A finished pixel's depth lets no sphere pass.
    gl_FragDepth = state_is_peeling(state) ? 1.0 : 0.0;
}
