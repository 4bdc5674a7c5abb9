// Samples along a ray, then bisections (Mueller, Grottel and Ertl 2007, section 3.1). Four samples are taken at a time, so that a list
// is read once for all of them; and of each the slope as well. Where it shows that the density may reach the isovalue between two
// samples, the greatest density there is looked for: such are the rims of balls. A part of the fluid that is thinner along the ray than
// a step, and of which the slopes at its ends say nothing, is missed.
#include "lib/leaf_ball.glsl"

uniform int samples;    // along the diameter of an influence sphere
uniform int bisections;

// What a sample may lack of the isovalue, as a share of it, where the tangents cross that says that there may be a crossing.
const float PEAK_SLACK = 0.1;
const int PEAK_LEVELS = 4;

const int MARCHES = 0;
const int CLIMBS = 1; // between two samples, to the greatest density
const int REFINES = 2;

// A place on the ray: the distance, how much is missing to a crossing, the slope towards it.
#define Sample vec3

void march_sample(Leaf leaf, vec4 at, out vec4 density, out vec4 slope) {
    density = vec4(0.0);
    slope = vec4(0.0);
    for (uint i = 0u; i < min(leaf.count, MOST_ENTRIES); i++) {
        LeafBall ball = leaf_ball(leaf, i);
        vec4 offset = (at - ball.middle) * ball.inverse;
        vec4 x = ball.peak - offset * offset;
        if (all(lessThanEqual(x, vec4(0.0))))
            continue;
        for (int k = 0; k < 4; k++) {
            density[k] += ball.weight * kernel_value(x[k]);
            slope[k] -= 2.0 * ball.weight * kernel_derivative(x[k]) * offset[k] * ball.inverse;
        }
    }
}

// Whether the tangents at two samples before a crossing meet where there may be one between them.
bool march_may_peak(Sample low, Sample high) {
    if (low.z <= 0.0 || high.z >= 0.0)
        return false;
    float on = (low.y - high.y - high.z * (high.x - low.x)) / (low.z - high.z);
    return low.y - low.z * clamp(on, 0.0, high.x - low.x) <= PEAK_SLACK * isovalue;
}

// Around where the slope is 0, if it changes evenly.
vec4 march_climb(Sample low, Sample high) {
    float peak = mix(low.x, high.x, low.z / (low.z - high.z));
    return vec4(mix(low.x, peak, 0.8), peak, mix(peak, high.x, 0.2), mix(peak, high.x, 0.6));
}

// Where the field first crosses the isovalue in [begin, end], either way. Where `ends_inside` the end is known to be inside the fluid.
bool march(Leaf leaf, float begin, float end, float radius, bool ends_inside, out float t, out bool is_inside) {
    int parts = int(clamp(ceil((end - begin) * float(samples) / (2.0 * radius)), 1.0, float(samples + 1)));
    float step = (end - begin) / float(parts);
    float side = 1.0;
    int mode = MARCHES, next = 0, resume = 0, level = 0, left = bisections;
    Sample low = Sample(begin, 0.0, 0.0), high = low, outer = low;
    bool is_first = true;
    vec4 at = begin + step * min(vec4(0.0, 1.0, 2.0, 3.0), float(parts));
    t = end;
    is_inside = false;
    for (uint i = 0u; i < MOST_STEPS; i++) {
        vec4 density, slope;
        march_sample(leaf, at, density, slope);
        if (is_first) {
            is_inside = density.x >= isovalue;
            side = is_inside ? -1.0 : 1.0;
        }
        vec4 gap = side * (isovalue - density);
        slope *= side;
        bool has_crossed = false, climbs = false;
        // The last of five is the end of the bracket.
        for (int k = 0; k < 5; k++) {
            if (k == 4 && mode == MARCHES)
                break;
            Sample here = k < 4 ? Sample(at[min(k, 3)], gap[min(k, 3)], slope[min(k, 3)]) : high;
            if (is_first && k == 0) {
                low = here;
                continue;
            }
            if (here.x <= low.x)
                continue;
            if (here.y <= 0.0) {
                has_crossed = true;
            } else if (mode != REFINES && level < PEAK_LEVELS && march_may_peak(low, here)) {
                climbs = true;
                if (mode == MARCHES) {
                    outer = here;
                    resume = next + k + 1;
                }
            }
            if (has_crossed || climbs) {
                high = here;
                break;
            }
            low = here;
        }
        is_first = false;
        if (has_crossed) {
            if (mode == REFINES)
                left -= 2;
            if (left <= 0) {
                // Within the last part by its secant.
                t = mix(low.x, high.x, clamp(low.y / max(low.y - high.y, 1e-30), 0.0, 1.0));
                return true;
            }
            mode = REFINES;
            // Two bisections at once, or the last.
            at = mix(vec4(low.x), vec4(high.x), left > 1 ? vec4(0.25, 0.5, 0.75, 0.75) : vec4(0.5));
            continue;
        }
        if (climbs) {
            mode = CLIMBS;
            level++;
            at = march_climb(low, high);
            continue;
        }
        if (mode == CLIMBS) {
            low = outer;
            next = resume;
        } else {
            next += 4;
        }
        mode = MARCHES;
        level = 0;
        if (next > parts) {
            t = end;
            return ends_inside && !is_inside;
        }
        at = begin + step * min(float(next) + vec4(0.0, 1.0, 2.0, 3.0), float(parts));
    }
    return false;
}
