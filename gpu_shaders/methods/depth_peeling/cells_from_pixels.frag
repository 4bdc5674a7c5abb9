// The range of distances that the pixels of a fine cell ask for: PHASE_PEELING or PHASE_WALKING from their last crossing to
// their barrier, PHASE_DONE at their surface. A pixel goes on asking until both of its states know that it is done.
#include "lib/range.glsl"
#include "methods/depth_peeling/state.glsl"

uniform usampler2D state_tx;
uniform usampler2D older_state_tx;
uniform sampler2D barrier_tx;

layout(location = 0) out vec2 out_range;

vec2 pixel_range(ivec2 pixel) {
    State state = state_unpack(texelFetch(state_tx, pixel, 0).xy);
#if CELL_PHASE == 2
    return state_has_surface(state) ? vec2(state.depth) : EMPTY_RANGE;
#else
    if (state.phase == uint(CELL_PHASE))
        return vec2(state.depth, texelFetch(barrier_tx, pixel, 0).x);
    State older = state_unpack(texelFetch(older_state_tx, pixel, 0).xy);
    return older.phase == uint(CELL_PHASE) ? vec2(older.depth) : EMPTY_RANGE;
#endif
}

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * CELL_SIZE;
    ivec2 last = textureSize(state_tx, 0) - 1;
    vec2 range = EMPTY_RANGE;
    for (int y = 0; y < CELL_SIZE; y++)
        for (int x = 0; x < CELL_SIZE; x++)
            range = range_join(range, pixel_range(min(corner + ivec2(x, y), last)));
    out_range = range;
}
