// Searches the interval between the last crossing and the next for the surface, with the blended sum of its balls.
#include "methods/depth_peeling/interval.glsl"

uniform usampler2D state_tx;
uniform usampler2D crossing_tx;
uniform sampler2D depth_tx;
uniform sampler2D density_0_tx;
uniform sampler2D density_1_tx;
uniform sampler2D density_2_tx;

layout(location = 0) out uvec4 out_state;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    State state = state_unpack(texelFetch(state_tx, pixel, 0).xy);
    float depth = texelFetch(depth_tx, pixel, 0).x;
    if (state_is_peeling(state) && depth == 1.0) {
        state.state = STATE_DONE;
        state.depth = NO_SURFACE;
    } else if (state_is_peeling(state)) {
        Ray ray = ray_from_pixel(gl_FragCoord.xy);
        float root = BEZIER_NO_ROOT;
        if (state.crossing != 0u && depth > state.depth) {
            float density[KERNEL_DEGREE + 1];
            vec4 sums[3] = vec4[3](texelFetch(density_0_tx, pixel, 0), texelFetch(density_1_tx, pixel, 0),
                                   texelFetch(density_2_tx, pixel, 0));
            for (int i = 0; i <= KERNEL_DEGREE; i++)
                density[i] = sums[i / 4][i % 4];
            state.state = interval_start(state.state, density);
            root = interval_root(density, state.state == STATE_INSIDE);
        }
        if (root <= 1.0) {
            state = interval_done(state, root, depth, ray);
        } else {
            state.crossing = texelFetch(crossing_tx, pixel, 0).x;
            state.depth = depth;
        }
    }
    out_state = uvec4(state_pack(state), 0u, 0u);
    gl_FragDepth = state_is_peeling(state) ? 1.0 : 0.0;
}
