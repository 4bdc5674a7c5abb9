// The range of distances in a fine cell from where the plane is to where balls are asked for, scaled.
#include "lib/range.glsl"
#include "lib/sampling/samples.glsl"
#include "methods/walking_depth_plane/walk.glsl"

uniform sampler2D samples_tx;
uniform sampler2D place_tx;
uniform sampler2D pace_tx;

layout(location = 0) out vec2 out_range;

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * CELL_SIZE;
    ivec2 last = textureSize(samples_tx, 0) - 1;
    vec2 range = EMPTY_RANGE;
    for (int y = 0; y < CELL_SIZE; y++) {
        for (int x = 0; x < CELL_SIZE; x++) {
            ivec2 pixel = min(corner + ivec2(x, y), last);
            vec4 samples = texelFetch(samples_tx, pixel, 0);
            if (!samples_asked(samples))
                continue;
            Walk walk = walk_unpack(texelFetch(place_tx, pixel, 0), texelFetch(pace_tx, pixel, 0).xy);
            range = range_join(range, vec2(walk.t, walk_horizon(walk, samples_farthest(samples))) * depth_scale);
        }
    }
    out_range = range;
}
