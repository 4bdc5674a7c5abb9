// The ball's density at the four samples of each pixel, by additive blending of colours; and by MIN of alphas where it limits the
// samples, and how small it is. Balls that begin behind the samples tell where, if the pixel looks so far.
#include "lib/kernel.glsl"
#include "lib/sampling/samples.glsl"
#include "methods/walking_depth_plane/walk.glsl"

uniform sampler2D samples_tx;
uniform sampler2D place_tx;

flat in vec4 v_sphere;
flat in vec2 v_density;
layout(location = 0) out vec4 out_near; // densities at the first three samples; where the first ball begins that limits them
layout(location = 1) out vec4 out_far;  // at the fourth; how many balls reach it; 0; the least of ball_pace

// Over what way a ball may let the density rise above the threshold and fall again: the radius that it shows alone, within bounds, as
// a ball too light to be seen still changes the density over its own size; and for one so heavy that its rim counts not more than half
// of what the ray has of it.
float ball_pace(Chord chord, vec2 density) {
    float pace = clamp(density.y, 0.125 * chord.radius, 0.5 * chord.radius);
    bool counts = abs(density.x) * kernel_value(chord.peak) > 0.1 * threshold;
    return counts ? min(pace, chord_half_length(chord)) : pace;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 samples = texelFetch(samples_tx, pixel, 0), place = texelFetch(place_tx, pixel, 0);
    Chord chord = ball_chord(Ball(v_sphere.xyz, v_sphere.w), ray_from_pixel(gl_FragCoord.xy));
    float half_length = chord_half_length(chord);
    float begin = chord.middle - half_length, end = chord.middle + half_length;
    float from = place.x, spacing = place.w, last = samples_farthest(samples);
    if (!samples_asked(samples) || chord.peak <= 0.0 || end <= from)
        discard;
    out_near = out_far = vec4(0.0, 0.0, 0.0, NOTHING);
    if (begin > last) {
        out_near.w = begin;
        return;
    }
    vec4 from_middle = (samples - chord.middle) / chord.radius;
    vec4 x = chord.peak - from_middle * from_middle;
    vec4 density = v_density.x * vec4(kernel_value(x.x), kernel_value(x.y), kernel_value(x.z), kernel_value(x.w));
    out_near.xyz = density.xyz;
    float pace = ball_pace(chord, v_density);
    out_far = vec4(density.w, float(end > last), 0.0, pace);
    // The same step, computed elsewhere, may be a little longer.
    if (step_share * pace * 1.0001 < spacing)
        out_near.w = max(begin, from);
}
