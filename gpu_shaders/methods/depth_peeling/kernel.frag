// The front of each kernel sphere: there the density reaches the isovalue by this ball alone (Kanamori et al. 2008, 5.2).
#include "lib/conservative_depth.glsl"
#include "lib/chord.glsl"
#include "methods/depth_peeling/clip.glsl"

flat in vec4 v_sphere;
flat in vec2 v_density;

void main() {
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    Chord chord = ball_chord(Ball(v_sphere.xyz, v_density.y), ray);
    float front = (chord.middle - chord_half_length(chord)) * depth_scale;
    // Where the ray starts inside the kernel sphere it starts inside the fluid, which is another pass' matter.
    if (chord.peak <= 0.0 || front < clip_start(ray) || front > clip_end(ray))
        discard;
    gl_FragDepth = front;
}
