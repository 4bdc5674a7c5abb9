// One fragment for each pixel whose ray still walks.
#include "methods/walking_depth_plane/walk.glsl"

uniform sampler2D place_tx;

void main() {
    if (texelFetch(place_tx, ivec2(gl_FragCoord.xy), 0).z < 0.0)
        discard;
}
