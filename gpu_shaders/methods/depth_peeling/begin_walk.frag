// A ray whose list is full goes on without one, from its last crossing; the others keep what they have found.
#include "methods/depth_peeling/state.glsl"

uniform usampler2D state_tx;
uniform float walk_window; // Blender units

layout(location = 0) out uvec4 out_state;

void main() {
    uvec4 texel = texelFetch(state_tx, ivec2(gl_FragCoord.xy), 0);
    out_state = uvec4(texel.xy, floatBitsToUint(walk_window), 0u);
}
