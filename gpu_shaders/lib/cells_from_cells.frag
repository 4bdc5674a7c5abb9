// The range of distances that a larger cell asks for, from those of the smaller ones in it.
#include "lib/range.glsl"

uniform sampler2D smaller_tx;
uniform int smaller_count; // along a larger cell's side

layout(location = 0) out vec2 out_range;

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * smaller_count;
    ivec2 last = textureSize(smaller_tx, 0) - 1;
    vec2 range = EMPTY_RANGE;
    for (int y = 0; y < smaller_count; y++)
        for (int x = 0; x < smaller_count; x++)
            range = range_join(range, texelFetch(smaller_tx, min(corner + ivec2(x, y), last), 0).xy);
    out_range = range;
}
