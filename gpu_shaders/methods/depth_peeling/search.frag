// Searches the way from the last crossing to the next for the surface, with the balls of the list; then enters the next ball
// into the list (Kanamori et al. 2008, section 4.2). A ball leaves the list where the ray leaves its influence sphere: that is
// known once it is in the list, so only entries are peeled.
#include "lib/ball.glsl"
#include "lib/kernel.glsl"
#include "lib/bezier_clipping.glsl"
#include "methods/depth_peeling/clip.glsl"

// Four texels a pixel: the state, and up to 14 balls that the ray is in.
uniform usampler2D state_tx;
uniform usampler2D list_1_tx;
uniform usampler2D list_2_tx;
uniform usampler2D list_3_tx;
uniform usampler2D crossing_tx;
uniform sampler2D depth_tx;
uniform sampler2D barrier_tx;
uniform float isovalue;

layout(location = 0) out uvec4 out_state;
layout(location = 1) out uvec4 out_list_1;
layout(location = 2) out uvec4 out_list_2;
layout(location = 3) out uvec4 out_list_3;
#if DIAGNOSTICS
layout(location = 4) out uvec4 out_iterations;
uniform usampler2D iterations_tx;
#endif

// Balls, and where the ray leaves them, in scaled distances.
uint ids[14] = uint[14](0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u);
float exits[14];

// A lone ball's surface is its kernel sphere ("single case"). As a share of the interval, or BEZIER_NO_ROOT.
float lone_ball_root(uint id, float begin, float end, bool is_inside, Ray ray) {
    float kernel_radius = ball_density(id).y;
    if (kernel_radius <= 0.0)
        return is_inside ? 0.0 : BEZIER_NO_ROOT;
    Chord chord = ball_chord(Ball(ball_fetch(id).center, kernel_radius), ray);
    float half_chord = chord_half_length(chord);
    float front = chord.middle - half_chord, back = chord.middle + half_chord;
    if (is_inside) {
        float root = chord.peak > 0.0 ? max(back, begin) : begin;
        return root <= end ? (root - begin) / (end - begin) : BEZIER_NO_ROOT;
    }
    bool meets = chord.peak > 0.0 && front <= end && back > begin;
    return meets ? (max(front, begin) - begin) / (end - begin) : BEZIER_NO_ROOT;
}

// Where the density of the first `count` balls first comes to the isovalue, from below or, seen from inside, from above.
float blended_root(uint count, float begin, float end, bool is_inside, Ray ray) {
    float side = is_inside ? -1.0 : 1.0;
    float density[KERNEL_DEGREE + 1];
    for (int i = 0; i <= KERNEL_DEGREE; i++)
        density[i] = -side * isovalue;
    for (uint i = 0u; i < count; i++)
        kernel_add_bernstein(density, ball_chord(ball_fetch(ids[i]), ray), side * ball_density(ids[i]).x, begin, end);
    return bezier_first_root(density);
}

float interval_root(State state, float begin, float end, float barrier, Ray ray) {
    // Before the barrier no ball reaches the isovalue alone.
    if (state.count == 1u)
        return barrier < NO_BARRIER ? BEZIER_NO_ROOT : lone_ball_root(ids[0], begin, end, state.is_inside, ray);
    return blended_root(state.count, begin, end, state.is_inside, ray);
}

// The state with the surface there; none beyond the far clip distance.
State with_surface(State state, float depth, Ray ray) {
    return state_done(state, depth <= clip_end(ray) ? depth : NO_SURFACE);
}

// Follows the ray to `next`, the distance of the next entry or, where there is none, of the barrier.
State advance(State state, float next, float barrier, Ray ray) {
    for (uint i = 0u; i < state.count; i++) {
        Chord chord = ball_chord(ball_fetch(ids[i]), ray);
        exits[i] = (chord.middle + chord_half_length(chord)) * depth_scale;
    }
    // Each interval ends at an exit, the last at `next`.
    for (int interval = 0; interval <= LIST_LENGTH; interval++) {
        uint leaving = state.count;
        float end = next;
        for (uint i = 0u; i < state.count; i++) {
            if (exits[i] < end) {
                end = exits[i];
                leaving = i;
            }
        }
        if (state.count > 0u && end > state.depth) {
            float root = interval_root(state, state.depth / depth_scale, end / depth_scale, barrier, ray);
            if (root <= 1.0)
                return with_surface(state, mix(state.depth, end, root), ray);
            state.depth = end;
        }
        if (leaving == state.count)
            break;
        // The last of the list takes its place.
        state.count--;
        ids[leaving] = ids[state.count];
        exits[leaving] = exits[state.count];
    }
    state.depth = next;
    return state;
}

State enter(State state, uint crossing) {
    state.crossing = crossing;
    if (state.count == uint(LIST_LENGTH)) {
        state.phase = PHASE_WALKING;
    } else {
        ids[state.count] = crossing - 1u;
        state.count++;
    }
    return state;
}

// Texels that hold no ball of the list are not read.
void read_list(ivec2 pixel, uvec2 first, uint count) {
    uvec4 texel_1 = count > 2u ? texelFetch(list_1_tx, pixel, 0) : uvec4(0u);
    uvec4 texel_2 = count > 6u ? texelFetch(list_2_tx, pixel, 0) : uvec4(0u);
    uvec4 texel_3 = count > 10u ? texelFetch(list_3_tx, pixel, 0) : uvec4(0u);
    ids = uint[14](first.x, first.y, texel_1.x, texel_1.y, texel_1.z, texel_1.w, texel_2.x, texel_2.y, texel_2.z, texel_2.w,
                   texel_3.x, texel_3.y, texel_3.z, texel_3.w);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uvec4 texel = texelFetch(state_tx, pixel, 0);
    State state = state_unpack(texel.xy);
    float barrier = 0.0;
    if (state.phase == PHASE_PEELING) {
        read_list(pixel, texel.zw, state.count);
        barrier = texelFetch(barrier_tx, pixel, 0).x;
        Ray ray = ray_from_pixel(gl_FragCoord.xy);
        float next = texelFetch(depth_tx, pixel, 0).x;
        state = advance(state, next, barrier, ray);
        if (state.phase == PHASE_PEELING && next < barrier)
            state = enter(state, texelFetch(crossing_tx, pixel, 0).x);
        else if (state.phase == PHASE_PEELING)
            state = barrier < NO_BARRIER ? with_surface(state, barrier, ray) : state_done(state, NO_SURFACE);
    }
    out_state = uvec4(state_pack(state), ids[0], ids[1]);
    out_list_1 = uvec4(ids[2], ids[3], ids[4], ids[5]);
    out_list_2 = uvec4(ids[6], ids[7], ids[8], ids[9]);
    out_list_3 = uvec4(ids[10], ids[11], ids[12], ids[13]);
#if DIAGNOSTICS
    uvec3 before = texelFetch(iterations_tx, pixel, 0).xyz;
    out_iterations = uvec4(before.xy + bezier_effort.xy, max(before.z, bezier_effort.z), 0u);
#endif
    // Only what is nearer than the barrier may pass the next peel; nothing where the ray is done or walks.
    gl_FragDepth = state.phase == PHASE_PEELING ? barrier : 0.0;
}
