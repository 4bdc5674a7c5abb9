// How a ray goes on: by steps that surely do not pass the surface. With the gap g = isovalue - F, the slope s of F and a bound M on
// how fast s rises, the density stays below the isovalue for 2 g / (s + sqrt(s^2 + 2 M g)). A step that is surely safe is short, so
// the density is asked for at a guess of the crossing, from where the same root tells how far back there was surely none.
#include "methods/tile_lists/lists.glsl"

uniform float isovalue;
// What at least one of n balls must have of x that together reach the isovalue.
layout(std430, binding = 12) readonly buffer LeastX {
    float least_x[];
};

const float TINY = 1e-30;
// How fast the slope rises where one has to guess, as a share of the bound.
const float GUESSED_BEND = 0.25;
// A crossing is found where the density is this close to the isovalue, as a share of it; or where a step ends that can be wrong by
// no more than the second, nor than the third as a share of a radius, which matters at silhouettes.
const float TOLERANCE = 2e-6;
const float STEP_TOLERANCE = 8e-6;
const float STEP_SHARE = 1e-5;
// The least step, in radii of the least ball and as a share of the distance.
const float LEAST_STEP = 1e-5;
const float EPSILON = 1.2e-7;
// Shares of a distance by which the first possible crossing, and a kink, may be elsewhere than single precision says.
const float FIRST_MARGIN = 5e-7;
const float KINK_MARGIN = 1e-6;

float side = 1.0; // -1 for a ray that comes from inside the fluid

// The density and its slope at a distance.
vec2 density_at(float t) {
    vec2 sum = vec2(0.0);
    for (uint i = 0u; i < min(listed_count, uint(LIST_LENGTH)); i++) {
        Listed ball = ball_on_ray(listed[i]);
        float offset = (t - ball.middle) / ball.radius;
        float x = ball.peak - offset * offset;
        if (x > 0.0)
            sum += ball.weight * vec2(kernel_value(x), -2.0 * kernel_derivative(x) * offset / ball.radius);
    }
    return sum;
}

// Where a ray from outside may meet the surface next, `horizon` at the latest: where n balls touch it, one of them alone must give
// the nth part of the isovalue.
float next_possible(float t, float horizon) {
    float threshold = least_x[min(listed_count, 32u)];
    float first = horizon;
    for (uint i = 0u; i < min(listed_count, uint(LIST_LENGTH)); i++) {
        Listed ball = ball_on_ray(listed[i]);
        float reach_2 = ball.peak - threshold;
        if (reach_2 > 0.0) {
            float reach = ball.radius * sqrt(reach_2);
            if (ball.middle + reach > t)
                first = min(first, ball.middle - reach);
        }
    }
    return max(t, first - abs(first) * FIRST_MARGIN);
}

#if KERNEL_POWER == 1
// The slope of a kernel with a linear term jumps where an influence sphere begins or ends: before x it does not, and no slope ahead
// is steeper than y.
vec2 kinks_ahead(float t) {
    vec2 kinks = vec2(FAR, 0.0);
    for (uint i = 0u; i < min(listed_count, uint(LIST_LENGTH)); i++) {
        Listed ball = ball_on_ray(listed[i]);
        float half_length = half_chord(ball);
        float margin = (abs(t) + half_length) * KINK_MARGIN;
        float entry = ball.middle - half_length, exit = ball.middle + half_length;
        if (t <= entry + margin)
            kinks.x = min(kinks.x, entry - margin);
        if (t <= exit + margin)
            kinks.x = min(kinks.x, exit - margin);
        float pull = ball.weight * side * KERNEL_LOW * 2.0 / ball.radius / ball.radius;
        bool is_before = t <= entry + margin || pull < 0.0;
        if (t <= exit + margin)
            kinks.y += is_before ? abs(pull) * half_length : max(pull * (ball.middle - t), 0.0);
    }
    return kinks;
}
#endif

struct Steps {
    float ahead;  // no crossing is nearer
    float behind; // so far back the density was on the same side
    float guess;  // where the crossing is, about
    float slope;
    bool is_real;
};

Steps steps_from(float gap, float slope, float bend) {
    float pull = 2.0 * gap * bend;
    float square = slope * slope + pull;
    float steepness = abs(slope);
    float sum = max(sqrt(max(square, TINY)) + steepness, TINY);
    float near = 2.0 * gap / sum, far = sum / bend;
    float guess_sum = max(sqrt(max(slope * slope + GUESSED_BEND * pull, TINY)) + steepness, TINY);
    bool rises = slope > 0.0;
    return Steps(rises ? near : far, rises ? far : near, rises ? 2.0 * gap / guess_sum : 0.0, sum, square > 0.0);
}

// Walks with the listed balls from `t` to the horizon; true where the surface is met, then `t` is there.
bool walk_to(inout float t, float horizon) {
    float bend = max(side > 0.0 ? bounds.rise : bounds.fall, TINY);
    float bend_range = 0.5 * (bounds.rise + bounds.fall);
    float least_density = 0.99 * isovalue / float(listed_count);
    float at = t;
    for (uint i = 0u; i < MOST_STEPS && t < horizon; i++) {
        vec2 density = density_at(at);
        float gap = (isovalue - density.x) * side, slope = density.y * side;
        bool is_proven = at <= t;
        gap = is_proven ? max(gap, 0.0) : gap;
        Steps steps = steps_from(gap, slope, bend);
        is_proven = is_proven || (steps.is_real && at - steps.behind * (1.0 - 1e-6) <= t);
        float limit = horizon, next = at + steps.ahead;
#if KERNEL_POWER == 1
        vec2 kinks = kinks_ahead(t);
        limit = min(kinks.x, horizon);
        // Across a kink only the steepest slope that may come is a bound.
        next = max(min(next, limit), at + gap / max(kinks.y, TINY));
#endif
        float step = next - at;
        bool is_close = bend_range * step * step <= min(STEP_TOLERANCE * isovalue, steps.slope * STEP_SHARE * bounds.least_radius) && next < limit;
        bool is_there = abs(gap) <= TOLERANCE * isovalue;
        if (is_proven && (is_there || is_close)) {
            t = is_there ? at : at + steps.guess;
            return true;
        }
        if (!is_proven) {
            at = t;
            continue;
        }
        float least = max(LEAST_STEP * bounds.least_radius, abs(t) * EPSILON);
        t = min(max(next, t + least), horizon);
        if (side > 0.0 && density.x < least_density) {
            t = next_possible(t, horizon);
            at = t;
        } else {
#if KERNEL_POWER == 1
            at = t;
#else
            at = min(max(at + steps.guess, t), horizon);
#endif
        }
    }
    return false;
}
