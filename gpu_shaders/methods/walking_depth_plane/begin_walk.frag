// The start of each ray, at the near clip distance, as its only sample; whatever lies ahead is of interest.
#include "lib/ray.glsl"
#include "lib/sampling/samples.glsl"

uniform vec2 clip_distances; // planar

layout(location = 0) out vec4 out_samples;
layout(location = 1) out vec4 out_place; // see walk.glsl; no ball limits samples that are all at one place
layout(location = 2) out vec2 out_pace;

void main() {
    out_samples = vec4(clip_distances.x * ray_from_pixel(gl_FragCoord.xy).stretch);
    out_place = vec4(out_samples.x, 0.0, out_samples.x, 0.0);
    out_pace = vec2(0.0, 1.0); // it looks far
    gl_FragDepth = 1.0;
}
