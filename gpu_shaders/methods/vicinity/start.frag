// The density where a ray starts, and whether a ball of negative weight carves at the nearest kernel sphere; by blending.
#include "lib/kernel.glsl"
#include "lib/scene_camera.glsl"
#include "methods/vicinity/depth.glsl"

uniform sampler2D kernel_depth_tx;

flat in vec4 v_sphere;
flat in float v_weight;
layout(location = 0) out vec2 out_start; // density, carvings

float x_at(Ray ray, float t) {
    vec3 apart = (v_sphere.xyz - (scene_start(ray) + t * scene_direction(ray))) / v_sphere.w;
    return 1.0 - dot(apart, apart);
}

void main() {
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    float barrier = barrier_distance(texelFetch(kernel_depth_tx, ivec2(gl_FragCoord.xy), 0).x);
    bool carves = v_weight < 0.0 && barrier < NOWHERE && x_at(ray, barrier) > 0.0;
    out_start = vec2(v_weight * kernel_value(x_at(ray, clip_depths.x * ray.stretch)), float(carves));
}
