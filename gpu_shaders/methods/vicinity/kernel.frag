// The front of each kernel sphere: there the density reaches the isovalue by this ball alone, so that no ray comes farther.
#include "lib/conservative_depth.glsl"
#include "lib/scene_camera.glsl"
#include "methods/vicinity/depth.glsl"

flat in vec4 v_sphere;
flat in float v_kernel_radius;

void main() {
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    vec3 direction = scene_direction(ray);
    vec3 to_center = v_sphere.xyz - scene_start(ray);
    float middle = dot(to_center, direction);
    vec3 apart = (to_center - middle * direction) / v_kernel_radius;
    float peak = 1.0 - dot(apart, apart);
    float front = middle - v_kernel_radius * sqrt(max(peak, 0.0));
    // Where the ray starts inside the kernel sphere it starts inside the fluid, which is another pass' matter.
    if (peak <= 0.0 || front < clip_depths.x * ray.stretch || front > clip_depths.y * ray.stretch)
        discard;
    gl_FragDepth = clamp(front * depth_scale, 0.0, 1.0);
}
