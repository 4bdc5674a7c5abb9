// What samples leave of a bracket (Mishima et al. 2008, equation 6).
#include "lib/sampling/samples.glsl"
#include "lib/sampling/bracket.glsl"

uniform sampler2D bracket_tx;
uniform sampler2D samples_tx;
uniform sampler2D density_sum_tx;
uniform sampler2D side_tx; // see start.frag
uniform float threshold;

layout(location = 0) out vec4 out_bracket;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Bracket bracket = bracket_unpack(texelFetch(bracket_tx, pixel, 0));
    if (bracket_is_there(bracket)) {
        vec4 values = texelFetch(side_tx, pixel, 0).x * (texelFetch(density_sum_tx, pixel, 0) - threshold);
        bracket = bracket_narrow(bracket, texelFetch(samples_tx, pixel, 0), values);
    }
    out_bracket = bracket_pack(bracket);
}
