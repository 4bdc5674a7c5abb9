// The front of each kernel sphere, scaled: there the density reaches the threshold by this ball alone (Kanamori et al. 2008,
// section 5.2).
#include "lib/conservative_depth.glsl"
#include "lib/chord.glsl"

uniform float depth_scale;
uniform vec2 clip_distances; // planar

flat in vec4 v_sphere;
flat in vec2 v_density;

void main() {
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    Chord chord = ball_chord(Ball(v_sphere.xyz, v_density.y), ray);
    float front = chord.middle - chord_half_length(chord);
    // Where the ray starts inside the kernel sphere it starts inside the fluid, which is another pass' matter.
    if (chord.peak <= 0.0 || front < clip_distances.x * ray.stretch || front > clip_distances.y * ray.stretch)
        discard;
    gl_FragDepth = front * depth_scale;
}
