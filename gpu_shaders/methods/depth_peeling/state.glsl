// What a pixel knows between two peels. It lies in the first texel of its list:
//   x: the number of the last crossing (25 bits), the length of the list (4 bits), the state (3 bits)
//   y: the distance of the last crossing, later that of the surface, as a scaled float (see below)
// A crossing's number is 1 + 2 id + side (0: entry, 1: exit); 0: there was none yet.
//
// Distances are kept times `depth_scale`, a power of two that brings them below 1: so they fit a depth buffer, and no
// digit is lost. Crossings are ordered by (scaled distance, number).

uniform float depth_scale;

const uint STATE_FRESH = 0u;    // peeling, no interval was searched yet
const uint STATE_OUTSIDE = 1u;  // peeling, the ray started outside the fluid
const uint STATE_INSIDE = 2u;   // peeling, the ray started inside
const uint STATE_DONE = 3u;     // the distance is that of the surface, or none
const uint STATE_OVERFLOW = 4u; // the list was too short

// As scaled distances: nearer and farther than all.
const float BEFORE_ALL = -1.0;
const float NO_SURFACE = 2.0;

struct State {
    uint crossing;
    uint count;
    uint state;
    float depth;
};

State state_unpack(uvec2 texel) {
    return State(texel.x >> 7u, (texel.x >> 3u) & 15u, texel.x & 7u, uintBitsToFloat(texel.y));
}

uvec2 state_pack(State state) {
    return uvec2(state.crossing << 7u | state.count << 3u | state.state, floatBitsToUint(state.depth));
}

bool state_is_peeling(State state) {
    return state.state <= STATE_INSIDE;
}
