// What a pixel knows between two peels. It lies in the first texel of its list:
//   x: the number of the last crossing (25 bits), the length of the list (5 bits), the state (2 bits)
//   y: the distance of the last crossing, later that of the surface, as a scaled float (see below)
// A crossing's number is 1 + 2 id + side (0: entry, 1: exit); 0 comes before all.
//
// Distances are kept times `depth_scale`, a power of two that brings them below 1: so they fit a depth buffer, and no
// digit is lost. Crossings are ordered by (scaled distance, number).

uniform float depth_scale;

const uint STATE_OUTSIDE = 0u;  // peeling, the ray started outside the fluid
const uint STATE_INSIDE = 1u;   // peeling, the ray started inside
const uint STATE_DONE = 2u;     // the distance is that of the surface, or none
const uint STATE_OVERFLOW = 3u; // the list was too short

const float NO_SURFACE = 2.0; // as a scaled distance: farther than all

struct State {
    uint crossing;
    uint count;
    uint state;
    float depth;
};

State state_unpack(uvec2 texel) {
    return State(texel.x >> 7u, (texel.x >> 2u) & 31u, texel.x & 3u, uintBitsToFloat(texel.y));
}

uvec2 state_pack(State state) {
    return uvec2(state.crossing << 7u | state.count << 2u | state.state, floatBitsToUint(state.depth));
}

bool state_is_peeling(State state) {
    return state.state <= STATE_INSIDE;
}
