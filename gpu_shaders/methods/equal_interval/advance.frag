// What the samples tell a ray: the first that is above the threshold ends a bracket, else the ray goes on behind the last
// (Mishima et al. 2008, sections 3.2 and 5). An adaptive ray looks closer where the density has a peak between samples that may
// reach the threshold.
#include "lib/sampling/samples.glsl"
#include "lib/sampling/bracket.glsl"
#include "methods/equal_interval/march.glsl"

uniform sampler2D march_tx;
uniform sampler2D bracket_tx;
uniform sampler2D samples_tx;
uniform sampler2D density_sum_tx;
uniform sampler2D side_tx;
uniform sampler2D barrier_tx;
uniform float threshold;
uniform int most_samples;
uniform bool is_adaptive;

layout(location = 0) out vec4 out_march;
layout(location = 1) out vec4 out_bracket;

struct Point {
    float t;
    float value;
};

// Of three points of which the second is the highest: whether the density between them may be above the threshold. Between two
// equal samples a peak with straight sides is half a step of the side higher; round ones are lower.
bool peak_may_be_above(Point a, Point b, Point c) {
    return a.t < b.t && b.t < c.t && b.value >= max(a.value, c.value) && b.value + 0.5 * (b.value - min(a.value, c.value)) >= 0.0;
}

// Looks for the peak of the parabola through three points, by four samples around it.
Past past_of_peak(Point a, Point b, Point c) {
    float before = (b.value - a.value) / (b.t - a.t), behind = (c.value - b.value) / (c.t - b.t);
    float bend = min((behind - before) / (c.t - a.t), -1e-30);
    float peak = clamp(0.5 * (a.t + b.t - before / bend), 0.5 * (a.t + b.t), 0.5 * (b.t + c.t));
    return Past(a.t, a.value, min(b.t - a.t, c.t - b.t) / 24.0, peak);
}

void go_on(inout March march, inout Past past, vec4 samples, vec4 values) {
    float width = samples.y - samples.x;
    // On the way of a leap nothing rises: what is above the threshold behind it is so from there on.
    if (samples.x > march.asked && values.x >= 0.0) {
        march.t = samples.x;
        march.value = values.x;
    }
    for (int i = 0; i < 4; i++) {
        if (march.status == GOING && values[i] >= 0.0) {
            out_bracket = bracket_pack(Bracket(march.t, samples[i], march.value, values[i]));
            march.status = FOUND;
        } else if (march.status == GOING) {
            Point a = Point(past.t, past.value), b = Point(march.t, march.value), c = Point(samples[i], values[i]);
            past = Past(b.t, b.value, 1.0, 0.0);
            march.used++;
            if (march.used >= most_samples) {
                march.status = GAVE_UP;
            } else if (is_adaptive && peak_may_be_above(a, b, c)) {
                march.status = LOOKING;
                past = past_of_peak(a, b, c);
            }
            march.t = c.t;
            march.value = c.value;
            march.asked = c.t + width;
        }
    }
}

// The last sample is behind the peak; the one in `past` before it.
void look(inout March march, inout Past past, vec4 samples, vec4 values) {
    Point last = Point(past.t, past.value);
    int highest = 0;
    for (int i = 0; i < 4; i++) {
        if (march.status == LOOKING && values[i] >= 0.0) {
            out_bracket = bracket_pack(Bracket(last.t, samples[i], last.value, values[i]));
            march.status = FOUND;
        }
        last = Point(samples[i], values[i]);
        highest = values[i] > values[highest] ? i : highest;
    }
    if (march.status == FOUND)
        return;
    march.used += 4;
    Point a = Point(past.t, past.value), b = Point(samples[highest], values[highest]), c = Point(march.t, march.value);
    if (highest > 0)
        a = Point(samples[highest - 1], values[highest - 1]);
    if (highest < 3)
        c = Point(samples[highest + 1], values[highest + 1]);
    if (march.used >= most_samples) {
        march.status = GAVE_UP;
    } else if (peak_may_be_above(a, b, c)) {
        past = past_of_peak(a, b, c);
    } else {
        march.status = GOING;
        past = Past(march.t, NO_PAST, 1.0, 0.0);
    }
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    March march = march_unpack(texelFetch(march_tx, pixel, 0));
    vec2 side = texelFetch(side_tx, pixel, 0).xy;
    out_bracket = texelFetch(bracket_tx, pixel, 0);
    if (march.status == GOING || march.status == LOOKING) {
        vec4 samples = texelFetch(samples_tx, pixel, 0);
        vec4 values = side.x * (texelFetch(density_sum_tx, pixel, 0) - threshold);
        Past past = past_unpack(out_bracket);
        if (!samples_asked(samples))
            march.status = MISSED;
        else if (march.status == GOING)
            go_on(march, past, samples, values);
        else
            look(march, past, samples, values);
        if (march.status != FOUND)
            out_bracket = past_pack(past);
    }
    out_march = march_pack(march);
    gl_FragDepth = march_depth(march, side, texelFetch(barrier_tx, pixel, 0).x, depth_scale);
}
