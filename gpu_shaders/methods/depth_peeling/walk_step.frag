// Takes the step that surely does not pass the surface: with g to go, the slope s and a bound M on how fast it rises,
// 2 g / (s + sqrt(s^2 + 2 M g)). Close to the surface the steps become Newton's, and the last one, which has a least length,
// passes it. A tiny step alone does not tell that the surface is near: a bound on what is only ahead may make it so.
#include "lib/ray.glsl"
#include "methods/depth_peeling/clip.glsl"

uniform usampler2D state_tx;
uniform sampler2D sums_tx;
uniform sampler2D barrier_tx;
uniform float isovalue;

layout(location = 0) out uvec4 out_state;

// A step of this share of the distance is as good as none.
const float WALK_RESOLUTION = 3e-7;

// The length of the step, 0 on the surface; Blender units. `sums`: see walk_sum.frag.
float safe_step(float to_go, vec4 sums) {
    if (to_go <= 0.0)
        return 0.0;
    float slope = sums.y, bound = sums.z;
    float divisor = slope + sqrt(slope * slope + 2.0 * bound * to_go);
    return divisor > 0.0 ? 2.0 * to_go / divisor : 1e30;
}

// The state after a step, which ends with the window that the sums are made for. The next window is as long as seems useful.
State walk(State state, inout float window, vec4 sums, float barrier, Ray ray) {
    float begin = state.depth / depth_scale;
    float resolution = WALK_RESOLUTION * begin;
    float side = state.is_inside ? -1.0 : 1.0;
    float advance = safe_step(side * isovalue - sums.x, sums);
    if (advance <= 0.0)
        return state_done(state, state.depth);
    bool is_in_window = advance < window;
    state.depth = (begin + max(min(advance, window), resolution)) * depth_scale;
    // Where no ball is in the window either, on to the next one.
    if (!is_in_window && sums.xyz == vec3(0.0))
        state.depth = max(state.depth, sums.w);
    window = max(2.0 * min(advance, window), resolution);
    if (state.depth > min(barrier, clip_end(ray)))
        return state_done(state, barrier < NO_BARRIER ? barrier : NO_SURFACE);
    return state;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uvec4 texel = texelFetch(state_tx, pixel, 0);
    State state = state_unpack(texel.xy);
    float window = uintBitsToFloat(texel.z);
    if (state.phase == PHASE_WALKING) {
        float barrier = texelFetch(barrier_tx, pixel, 0).x;
        state = walk(state, window, texelFetch(sums_tx, pixel, 0), barrier, ray_from_pixel(gl_FragCoord.xy));
    }
    out_state = uvec4(state_pack(state), floatBitsToUint(window), 0u);
}
