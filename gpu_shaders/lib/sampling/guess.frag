// Samples that narrow a bracket: where the secant meets the threshold and a little before and behind, so that mostly a
// sixteenth of it remains; and the middle, so that never more than half does.
#include "lib/sampling/samples.glsl"
#include "lib/sampling/bracket.glsl"

uniform sampler2D bracket_tx;

layout(location = 0) out vec4 out_samples;

const float ASIDE = 1.0 / 32.0; // of the bracket's width

void main() {
    Bracket bracket = bracket_unpack(texelFetch(bracket_tx, ivec2(gl_FragCoord.xy), 0));
    out_samples = NO_SAMPLES;
    if (bracket_is_there(bracket)) {
        float aside = ASIDE * (bracket.behind - bracket.before);
        vec3 around = bracket_secant(bracket) + vec3(-aside, 0.0, aside);
        float middle = 0.5 * (bracket.before + bracket.behind);
        out_samples = clamp(vec4(around, middle), bracket.before, bracket.behind);
    }
    gl_FragDepth = samples_depth(out_samples);
}
