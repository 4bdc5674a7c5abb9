// The front of each kernel sphere: there the density reaches the isovalue by this ball alone, so that no ray comes farther.
#include "lib/conservative_depth.glsl"
#include "lib/scene_camera.glsl"
#include "methods/vicinity/depth.glsl"
#include "methods/vicinity/kernel_sphere.glsl"

flat in vec4 v_sphere;
flat in float v_kernel_radius;

void main() {
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    vec2 chord = kernel_sphere_chord(scene_start(ray), scene_direction(ray), v_sphere.xyz, v_kernel_radius);
    float front = chord.x - chord.y;
    // Where the ray starts inside the kernel sphere it starts inside the fluid, which is another pass' matter.
    if (chord.y <= 0.0 || front < clip_depths.x * ray.stretch || front > clip_depths.y * ray.stretch)
        discard;
    gl_FragDepth = clamp(front * depth_scale, 0.0, 1.0);
}
