// The density where a ray starts, and whether a ball of negative weight carves at the nearest kernel sphere; by blending.
#include "lib/kernel.glsl"
#include "methods/depth_peeling/clip.glsl"

uniform sampler2D kernel_depth_tx;

flat in vec4 v_sphere;
flat in vec2 v_density;
layout(location = 0) out vec4 out_start; // density, carvings

void main() {
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    Chord chord = ball_chord(Ball(v_sphere.xyz, v_sphere.w), ray);
    float kernel_depth = texelFetch(kernel_depth_tx, ivec2(gl_FragCoord.xy), 0).x;
    bool carves = v_density.x < 0.0 && chord_x(chord, kernel_depth / depth_scale) > 0.0;
    out_start = vec4(v_density.x * kernel_value(chord_x(chord, clip_start(ray) / depth_scale)), float(carves), 0.0, 0.0);
}
