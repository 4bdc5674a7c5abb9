// One fragment for each ray that the limit has left without an answer.
#include "methods/equal_interval/march.glsl"

uniform sampler2D march_tx;

void main() {
    int status = march_unpack(texelFetch(march_tx, ivec2(gl_FragCoord.xy), 0)).status;
    if (status == FOUND || status == MISSED)
        discard;
}
