// The distance of the surface as the only sample: where a bracket's secant meets the threshold; or its end where that is not
// wanted. None beyond the clip distance.
#include "lib/ray.glsl"
#include "lib/sampling/samples.glsl"
#include "lib/sampling/bracket.glsl"

uniform sampler2D bracket_tx;
uniform vec2 clip_distances; // planar
uniform bool uses_secant;

layout(location = 0) out vec4 out_samples;

void main() {
    Bracket bracket = bracket_unpack(texelFetch(bracket_tx, ivec2(gl_FragCoord.xy), 0));
    float t = bracket_secant(bracket);
    // Where the secant ends outside, because the density leaps up, no ball may reach there to tell the normal.
    if (t <= bracket.before || !uses_secant)
        t = bracket.behind;
    bool is_seen = bracket_is_there(bracket) && t <= clip_distances.y * ray_from_pixel(gl_FragCoord.xy).stretch;
    out_samples = is_seen ? vec4(t) : NO_SAMPLES;
    gl_FragDepth = samples_depth(out_samples);
}
