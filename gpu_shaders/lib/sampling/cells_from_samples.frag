// The range of distances of all samples in a fine cell.
#include "lib/range.glsl"
#include "lib/sampling/samples.glsl"

uniform sampler2D samples_tx;

layout(location = 0) out vec2 out_range;

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * CELL_SIZE;
    ivec2 last = textureSize(samples_tx, 0) - 1;
    vec2 range = EMPTY_RANGE;
    for (int y = 0; y < CELL_SIZE; y++) {
        for (int x = 0; x < CELL_SIZE; x++) {
            vec4 samples = texelFetch(samples_tx, min(corner + ivec2(x, y), last), 0);
            if (samples_asked(samples))
                range = range_join(range, vec2(samples_nearest(samples), samples_farthest(samples)) * depth_scale);
        }
    }
    out_range = range;
}
