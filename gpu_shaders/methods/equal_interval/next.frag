// Where the ray may go on for this ball, by blending: the least of the first three, the sum of the last (Mishima et al. 2008,
// equations 3 and 4).
//
// The ball's span is the half of its chord in which its density rises for the ray. Beyond it the ball lets the density only fall.
// One more interval belongs to it, so that there is a sample behind the highest density.
#include "lib/chord.glsl"
#include "methods/equal_interval/march.glsl"

uniform sampler2D march_tx;
uniform sampler2D side_tx;
uniform float interval;       // a share of the influence radius
uniform float greatest_weight;

flat in vec4 v_sphere;
flat in vec2 v_density;
layout(location = 0) out vec4 out_next; // distance; interval there; end of the first samples after a leap; crowd

// Not more than half of the radius that the ball shows alone (section 6); but where that is next to nothing it says nothing.
float ball_interval() {
    float alone = v_density.y > 0.0 ? max(0.5 * v_density.y, v_sphere.w / 64.0) : v_sphere.w;
    return min(interval * v_sphere.w, alone);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    March march = march_unpack(texelFetch(march_tx, pixel, 0));
    Chord chord = ball_chord(Ball(v_sphere.xyz, v_sphere.w), ray_from_pixel(gl_FragCoord.xy));
    float half_length = chord_half_length(chord);
    float turned = v_density.x * texelFetch(side_tx, pixel, 0).x;
    float begin = turned > 0.0 ? chord.middle - half_length : chord.middle;
    float end = turned > 0.0 ? chord.middle : chord.middle + half_length;
    float own = ball_interval();
    if (march.status != GOING || chord.peak <= 0.0 || turned == 0.0 || end + own < march.asked)
        discard;
    float next = max(begin, march.asked);
    // Four samples at this ball's interval, or all of them before it begins.
    float here = max(own, 0.25 * (begin - march.asked));
    float steepness = abs(v_density.x) / greatest_weight * sqrt(chord.peak) / chord.radius;
    out_next = vec4(next, here, next + 4.0 * own, begin <= march.asked + own ? steepness : 0.0);
}
