// The search for the surface between two crossings.
#include "lib/kernel.glsl"
#include "lib/bezier_clipping.glsl"
#include "methods/depth_peeling/state.glsl"

uniform float isovalue;
uniform vec2 clip_distances; // planar

// Whether a ray starts inside the fluid: the first interval that is searched tells. It begins at the near clip distance, or
// where the ray enters its first influence sphere and the density is 0. `density`: its Bernstein form over the interval.
uint interval_start(uint state, float density[KERNEL_DEGREE + 1]) {
    return state != STATE_FRESH ? state : density[0] >= isovalue ? STATE_INSIDE : STATE_OUTSIDE;
}

// Where the density first comes to the isovalue, from below or, seen from inside, from above. `density`: its Bernstein
// form over the interval. As a share of the interval, or BEZIER_NO_ROOT.
float interval_root(float density[KERNEL_DEGREE + 1], bool is_inside) {
    for (int i = 0; i <= KERNEL_DEGREE; i++)
        density[i] = is_inside ? isovalue - density[i] : density[i] - isovalue;
    return bezier_first_root(density);
}

// The same for a lone ball, whose surface is its kernel sphere ("single case"); in distances.
float interval_kernel_sphere_root(Chord chord, float kernel_radius, float begin, float end, bool is_inside) {
    float half_chord_2 = kernel_radius * kernel_radius - (1.0 - chord.peak) * chord.radius * chord.radius;
    float half_chord = sqrt(max(half_chord_2, 0.0));
    float front = chord.middle - half_chord, back = chord.middle + half_chord;
    if (is_inside) {
        float root = half_chord_2 > 0.0 ? max(back, begin) : begin;
        return root <= end ? (root - begin) / (end - begin) : BEZIER_NO_ROOT;
    }
    bool meets = half_chord_2 > 0.0 && front <= end && back > begin;
    return meets ? (max(front, begin) - begin) / (end - begin) : BEZIER_NO_ROOT;
}

// The state with the surface found at the share `root` of the interval up to `end`; none beyond the far clip distance.
State interval_done(State state, float root, float end, Ray ray) {
    float depth = mix(state.depth, end, root);
    bool visible = depth <= clip_distances.y * ray.stretch * depth_scale;
    return State(0u, 0u, STATE_DONE, visible ? depth : NO_SURFACE);
}
