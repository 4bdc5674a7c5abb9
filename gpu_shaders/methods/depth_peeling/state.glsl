// What a pixel knows between two peels. It lies in the first texel of its list:
//   x: the number of the last crossing (24 bits), the length of the list (5 bits), the phase (2 bits), whether the ray
//      started inside the fluid (1 bit)
//   y: the distance of the last crossing, later that of the surface, as a scaled float (see below)
// The number of the crossing into a ball is 1 + its id; 0: there was none yet. Crossings are ordered by (scaled distance,
// number).
//
// Distances are kept times `depth_scale`, a power of two that brings them below 1/2: so they fit a depth buffer, and no
// digit is lost.

uniform float depth_scale;

const uint PHASE_PEELING = 0u;
const uint PHASE_WALKING = 1u; // the list was too short; the surface is behind the last crossing
const uint PHASE_DONE = 2u;    // the distance is that of the surface, or none

// As scaled distances: nearer and farther than all. NO_BARRIER is also the greatest value of a depth buffer.
const float BEFORE_ALL = -1.0;
const float NO_BARRIER = 1.0;
const float NO_SURFACE = 2.0;

struct State {
    uint crossing;
    uint count;
    uint phase;
    bool is_inside;
    float depth;
};

State state_unpack(uvec2 texel) {
    return State(texel.x >> 8u, (texel.x >> 3u) & 31u, (texel.x >> 1u) & 3u, (texel.x & 1u) == 1u, uintBitsToFloat(texel.y));
}

uvec2 state_pack(State state) {
    return uvec2(state.crossing << 8u | state.count << 3u | state.phase << 1u | uint(state.is_inside), floatBitsToUint(state.depth));
}

State state_done(State state, float depth) {
    return State(0u, 0u, PHASE_DONE, state.is_inside, depth);
}

bool state_has_surface(State state) {
    return state.phase == PHASE_DONE && state.depth != NO_SURFACE;
}
