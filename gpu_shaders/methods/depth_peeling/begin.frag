// Every ray starts at the near clip distance with an empty list. AGAIN: only those whose list overflowed, the others keep
// their surface.
#include "lib/ray.glsl"
#include "methods/depth_peeling/state.glsl"

uniform vec2 clip_distances; // planar
#ifdef AGAIN
uniform usampler2D state_tx;
#endif

layout(location = 0) out uvec4 out_state;

void main() {
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    State state = State(0u, 0u, STATE_OUTSIDE, clip_distances.x * ray.stretch * depth_scale);
#ifdef AGAIN
    State before = state_unpack(texelFetch(state_tx, ivec2(gl_FragCoord.xy), 0).xy);
    if (before.state != STATE_OVERFLOW)
        state = State(0u, 0u, STATE_DONE, before.state == STATE_DONE ? before.depth : NO_SURFACE);
#endif
    out_state = uvec4(state_pack(state), 0u, 0u);
    // A finished pixel's depth lets no sphere pass.
    gl_FragDepth = state_is_peeling(state) ? 1.0 : 0.0;
}
