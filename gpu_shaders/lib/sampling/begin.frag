// The start of each ray, at the near clip distance, as its only sample.
#include "lib/ray.glsl"
#include "lib/sampling/samples.glsl"

uniform vec2 clip_distances; // planar

layout(location = 0) out vec4 out_samples;

void main() {
    out_samples = vec4(clip_distances.x * ray_from_pixel(gl_FragCoord.xy).stretch);
    gl_FragDepth = samples_depth(out_samples);
}
