// One sample for each ray whose list was too short.
#include "methods/depth_peeling/state.glsl"

uniform usampler2D state_tx;

void main() {
    if (state_unpack(texelFetch(state_tx, ivec2(gl_FragCoord.xy), 0).xy).phase != PHASE_WALKING)
        discard;
}
