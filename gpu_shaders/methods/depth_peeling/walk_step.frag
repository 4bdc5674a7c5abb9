// Takes the step that surely does not pass the surface: with g to go, the slope s and a bound M on how fast it rises,
// 2 g / (s + sqrt(s^2 + 2 M g)). Close to the surface the steps become Newton's.
#include "lib/ray.glsl"
#include "methods/depth_peeling/clip.glsl"

uniform usampler2D state_tx;
uniform sampler2D sums_tx;
uniform sampler2D barrier_tx;
uniform float isovalue;

layout(location = 0) out uvec4 out_state;

// A step of this share of the distance is as good as none.
const float WALK_RESOLUTION = 3e-7;

struct Step {
    float advance; // Blender units
    bool arrives;
};

Step safe_step(float to_go, float slope, float bound) {
    if (to_go <= 0.0)
        return Step(0.0, true);
    float divisor = slope + sqrt(slope * slope + 2.0 * bound * to_go);
    return Step(divisor > 0.0 ? 2.0 * to_go / divisor : 1e30, false);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uvec4 texel = texelFetch(state_tx, pixel, 0);
    State state = state_unpack(texel.xy);
    float window = uintBitsToFloat(texel.z);
    if (state.phase == PHASE_WALKING) {
        Ray ray = ray_from_pixel(gl_FragCoord.xy);
        vec4 sums = texelFetch(sums_tx, pixel, 0);
        float begin = state.depth / depth_scale;
        float resolution = WALK_RESOLUTION * begin;
        float side = state.is_inside ? -1.0 : 1.0;
        Step next = safe_step(side * isovalue - sums.x, sums.y, sums.z);
        bool is_near = next.advance <= resolution;
        if (next.advance < window) {
            state.depth = (begin + max(next.advance, resolution)) * depth_scale;
            window = max(2.0 * next.advance, resolution);
        } else {
            // Nothing in the window; where no ball is either, on to the next one.
            state.depth = (begin + window) * depth_scale;
            if (sums.xyz == vec3(0.0))
                state.depth = max(state.depth, sums.w);
            window = max(2.0 * window, resolution);
        }
        float barrier = texelFetch(barrier_tx, pixel, 0).x;
        float end = min(barrier, clip_end(ray));
        if (next.arrives)
            state = state_done(state, begin * depth_scale);
        else if (state.depth > end)
            state = state_done(state, barrier < NO_BARRIER ? barrier : NO_SURFACE);
        else if (is_near)
            state = state_done(state, state.depth);
    }
    out_state = uvec4(state_pack(state), floatBitsToUint(window), 0u);
}
