// The range of distances in which the rays of a fine cell ask for balls: from where a ray goes on to its barrier.
#include "lib/range.glsl"
#include "methods/equal_interval/march.glsl"

uniform sampler2D march_tx;
uniform sampler2D depth_tx; // see march_depth
uniform float depth_scale;

layout(location = 0) out vec2 out_range;

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * CELL_SIZE;
    ivec2 last = textureSize(march_tx, 0) - 1;
    vec2 range = EMPTY_RANGE;
    for (int y = 0; y < CELL_SIZE; y++) {
        for (int x = 0; x < CELL_SIZE; x++) {
            ivec2 pixel = min(corner + ivec2(x, y), last);
            March march = march_unpack(texelFetch(march_tx, pixel, 0));
            if (march.status == GOING)
                range = range_join(range, vec2(march.asked * depth_scale, texelFetch(depth_tx, pixel, 0).x));
        }
    }
    out_range = range;
}
