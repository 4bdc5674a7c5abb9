// Searches the interval between the last crossing and the next for the surface, with the balls of the list; then enters
// the next crossing into the list (Kanamori et al. 2008, section 4.2).
#include "methods/depth_peeling/interval.glsl"

// Four texels a pixel: the state, and up to 14 balls that the ray is in.
uniform usampler2D state_tx;
uniform usampler2D list_1_tx;
uniform usampler2D list_2_tx;
uniform usampler2D list_3_tx;
uniform usampler2D crossing_tx;
uniform sampler2D depth_tx;

layout(location = 0) out uvec4 out_state;
layout(location = 1) out uvec4 out_list_1;
layout(location = 2) out uvec4 out_list_2;
layout(location = 3) out uvec4 out_list_3;

// The root as a share of the interval; settles on which side of the surface the ray started.
float list_root(uint ids[14], inout State state, float begin, float end, Ray ray) {
    if (state.count == 1u && state.state != STATE_FRESH) {
        Chord chord = ball_chord(ball_fetch(ids[0]), ray);
        return interval_kernel_sphere_root(chord, ball_density(ids[0]).y, begin, end, state.state == STATE_INSIDE);
    }
    float density[KERNEL_DEGREE + 1];
    for (int i = 0; i <= KERNEL_DEGREE; i++)
        density[i] = 0.0;
    for (uint i = 0u; i < state.count; i++)
        kernel_add_bernstein(density, ball_chord(ball_fetch(ids[i]), ray), ball_density(ids[i]).x, begin, end);
    state.state = interval_start(state.state, density);
    return interval_root(density, state.state == STATE_INSIDE);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uvec4 texel_0 = texelFetch(state_tx, pixel, 0), texel_1 = texelFetch(list_1_tx, pixel, 0);
    uvec4 texel_2 = texelFetch(list_2_tx, pixel, 0), texel_3 = texelFetch(list_3_tx, pixel, 0);
    State state = state_unpack(texel_0.xy);
    uint ids[14] = uint[14](texel_0.z, texel_0.w, texel_1.x, texel_1.y, texel_1.z, texel_1.w, texel_2.x, texel_2.y,
                            texel_2.z, texel_2.w, texel_3.x, texel_3.y, texel_3.z, texel_3.w);
    float depth = texelFetch(depth_tx, pixel, 0).x;

    if (state_is_peeling(state) && depth == 1.0) {
        state.state = STATE_DONE;
        state.depth = NO_SURFACE;
    } else if (state_is_peeling(state)) {
        Ray ray = ray_from_pixel(gl_FragCoord.xy);
        float root = BEZIER_NO_ROOT;
        if (depth > state.depth && state.count > 0u)
            root = list_root(ids, state, state.depth / depth_scale, depth / depth_scale, ray);
        uint crossing = texelFetch(crossing_tx, pixel, 0).x;
        uint id = (crossing - 1u) >> 1u;
        if (root <= 1.0) {
            state = interval_done(state, root, depth, ray);
        } else if ((crossing & 1u) == 0u) {
            // An exit: the last of the list takes its place.
            state.count--;
            uint last = ids[state.count];
            for (int i = 0; i < 14; i++)
                ids[i] = ids[i] == id ? last : ids[i];
        } else if (state.count == uint(LIST_LENGTH)) {
            state.state = STATE_OVERFLOW;
        } else {
            ids[state.count] = id;
            state.count++;
        }
        if (state_is_peeling(state)) {
            state.crossing = crossing;
            state.depth = depth;
        }
    }

    out_state = uvec4(state_pack(state), ids[0], ids[1]);
    out_list_1 = uvec4(ids[2], ids[3], ids[4], ids[5]);
    out_list_2 = uvec4(ids[6], ids[7], ids[8], ids[9]);
    out_list_3 = uvec4(ids[10], ids[11], ids[12], ids[13]);
    gl_FragDepth = state_is_peeling(state) ? 1.0 : 0.0;
}
