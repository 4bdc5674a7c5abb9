// The next samples: a step of the oracle apart where the plane walks; where it has found the surface the oracle's steps from both
// sides, where the secant meets the threshold, and the middle.
#include "lib/sampling/samples.glsl"
#include "methods/walking_depth_plane/walk.glsl"

uniform sampler2D place_tx;
uniform sampler2D pace_tx;
uniform sampler2D bracket_tx;

layout(location = 0) out vec4 out_samples;

// The depth buffer's greatest value: no ball is too far.
const float ANY_DISTANCE = 1.0;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Walk walk = walk_unpack(texelFetch(place_tx, pixel, 0), texelFetch(pace_tx, pixel, 0).xy);
    Bracket bracket = bracket_unpack(texelFetch(bracket_tx, pixel, 0));
    out_samples = NO_SAMPLES;
    if (bracket_is_there(bracket)) {
        if (!walk_has_arrived(bracket, walk.pace)) {
            float forward = bracket.before + oracle_forward(bracket.value_before, walk.pace);
            float back = bracket.behind - oracle_back(bracket.value_behind, walk.pace);
            vec4 places = vec4(forward, back, bracket_secant(bracket), 0.5 * (bracket.before + bracket.behind));
            out_samples = clamp(places, bracket.before, bracket.behind);
        }
    } else if (walk_goes_on(walk)) {
        out_samples = walk.first + walk.spacing * vec4(0.0, 1.0, 2.0, 3.0);
    }
    gl_FragDepth = samples_depth(out_samples);
    if (samples_asked(out_samples))
        gl_FragDepth = min(walk_horizon(walk, samples_farthest(out_samples)) * depth_scale, ANY_DISTANCE);
}
