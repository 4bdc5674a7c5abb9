// Whether each ray starts inside the fluid, at the near clip distance.
#include "methods/surface_particles/fluid.glsl"
#include "lib/scene_camera.glsl"

uniform vec2 clip_depths; // planar, from the anchor

layout(location = 0) out float out_inside;

void main() {
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    vec3 point = scene_start(ray) + clip_depths.x * ray.stretch * scene_direction(ray);
    out_inside = fluid_sample(point).density >= isovalue ? 1.0 : 0.0;
}
