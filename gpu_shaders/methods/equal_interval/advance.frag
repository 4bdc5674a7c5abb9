// What the samples tell a ray: the first that is above the threshold ends a bracket, else the ray goes on behind the last
// (Mishima et al. 2008, sections 3.2 and 5).
#include "lib/sampling/samples.glsl"
#include "lib/sampling/bracket.glsl"
#include "methods/equal_interval/march.glsl"

uniform sampler2D march_tx;
uniform sampler2D bracket_tx;
uniform sampler2D samples_tx;
uniform sampler2D density_sum_tx;
uniform sampler2D side_tx;
uniform float threshold;
uniform int most_samples;

layout(location = 0) out vec4 out_march;
layout(location = 1) out vec4 out_bracket;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    March march = march_unpack(texelFetch(march_tx, pixel, 0));
    out_bracket = texelFetch(bracket_tx, pixel, 0);
    if (march.status == GOING) {
        vec4 samples = texelFetch(samples_tx, pixel, 0);
        vec4 values = texelFetch(side_tx, pixel, 0).x * (texelFetch(density_sum_tx, pixel, 0) - threshold);
        if (!samples_asked(samples))
            march.status = MISSED;
        for (int i = 0; i < 4; i++) {
            if (march.status == GOING && values[i] >= 0.0) {
                out_bracket = bracket_pack(Bracket(march.t, samples[i], march.value, values[i]));
                march.status = FOUND;
            } else if (march.status == GOING) {
                march.t = samples[i];
                march.value = values[i];
                march.used++;
                if (march.used >= most_samples)
                    march.status = GAVE_UP;
            }
        }
        march.asked = samples.w + (samples.y - samples.x);
    }
    out_march = march_pack(march);
    gl_FragDepth = march_depth(march);
}
