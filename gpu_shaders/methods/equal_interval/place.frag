// The next four samples of each ray (Mishima et al. 2008, section 4.2), or those around a peak; none where no ball is ahead.
#include "lib/ray.glsl"
#include "lib/sampling/samples.glsl"
#include "methods/equal_interval/march.glsl"

uniform sampler2D march_tx;
uniform sampler2D bracket_tx;
uniform sampler2D next_tx;       // see next.frag
uniform vec2 clip_distances;     // planar
uniform float interval;          // a share of the influence radius
uniform float only_interval;     // of all balls; 0 where they differ
uniform bool is_adaptive;

layout(location = 0) out vec4 out_samples;

const float RESOLUTION = 4e-7; // shorter steps, as shares of the distance, are as good as none
const float CROWD = 4.0;       // more balls that rise as steeply as one can make a place crowded
const float SHORTEST = 0.25;   // of an interval

// The interval after a leap. next.z is a least sum of a ball's begin and four of its intervals; half of its distance is less than
// the greater of the two, for every ball.
float after_leap(vec4 next) {
    return only_interval > 0.0 ? only_interval : 0.125 * (next.z - next.x);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    March march = march_unpack(texelFetch(march_tx, pixel, 0));
    vec4 next = texelFetch(next_tx, pixel, 0);
    float end = clip_distances.y * ray_from_pixel(gl_FragCoord.xy).stretch;
    out_samples = NO_SAMPLES;
    bool leaps = next.x > march.asked;
    // The way from the last sample to the far clip distance has a sample at its end.
    if (!leaps && march.t < end)
        next.x = min(next.x, end);
    if (march.status == GOING && next.x <= end) {
        float width = leaps ? after_leap(next) : next.y;
        if (is_adaptive)
            width *= clamp(CROWD * interval / max(next.w * width, 1e-30), SHORTEST, 1.0);
        width = max(width, RESOLUTION * next.x);
        out_samples = next.x + width * vec4(0.0, 1.0, 2.0, 3.0);
    }
    if (march.status == LOOKING) {
        Past past = past_unpack(texelFetch(bracket_tx, pixel, 0));
        out_samples = past.peak + past.aside * vec4(-3.0, -1.0, 1.0, 3.0);
    }
    gl_FragDepth = samples_depth(out_samples);
}
