// One fragment for each pixel that asks for samples.
#include "lib/sampling/samples.glsl"

uniform sampler2D samples_tx;

void main() {
    if (!samples_asked(texelFetch(samples_tx, ivec2(gl_FragCoord.xy), 0)))
        discard;
}
