// Where a ray crosses the surface of the sum of balls that lie one after the other, by steps that cannot pass it; docs/fitted_bvh.md
// derives them. MET_LENGTH: balls that a stretch of a ray meets for which there is room. MOST_ENTRIES, MOST_STEPS: of loops.
#include "lib/leaf_ball.glsl"

// The field is on the surface where it is as close to the isovalue, relatively: some roundings of a sum.
const float CLOSE = 1e-6;
// A stretch of a ray is halved where half its length is more so many radii of the smallest ball on it.
const float LONGEST = 2.0;
const float LEAST_BEND = 1e-30;
const float FAR = 3e38;

// The balls that the stretch meets, as long as there is room for all of them; vectors, because indexed structures take four times
// the memory on some processors.
vec4 met[MET_LENGTH];
uint met_count;

// What bounds the field on the stretch.
struct LeafBounds {
    float most;     // the field is not greater
    float bend;     // nor its second derivative towards the isovalue
    float sharpest; // 1 / R of the smallest ball
};

LeafBounds leaf_gather(Leaf leaf, float reach, bool is_inside) {
    LeafBounds bounds = LeafBounds(0.0, LEAST_BEND, 0.0);
    met_count = 0u;
    for (uint i = 0u; i < min(leaf.count, MOST_ENTRIES); i++) {
        LeafBall ball = leaf_ball(leaf, leaf.first + i);
        float offset = (clamp(ball.middle, -reach, reach) - ball.middle) * ball.inverse;
        float nearest = ball.peak - offset * offset;
        if (nearest <= 0.0)
            continue;
        bool rises = (ball.weight > 0.0) != is_inside;
        float bend = rises ? kernel_steepest_rise(ball.peak) : kernel_steepest_fall(ball.peak);
        bounds.most += max(ball.weight, 0.0) * kernel_value(nearest);
        bounds.bend += abs(ball.weight) * bend * ball.inverse * ball.inverse;
        bounds.sharpest = max(bounds.sharpest, ball.inverse);
        if (met_count < uint(MET_LENGTH))
            met[met_count] = vec4(ball.peak, ball.middle, ball.inverse, ball.weight);
        met_count++;
    }
    return bounds;
}

// The field and its slope at a distance, and where the slope jumps next.
struct LeafValue {
    float field;
    float slope;
    float next_kink;
};

void leaf_add(inout LeafValue value, LeafBall ball, float at) {
    float offset = (at - ball.middle) * ball.inverse;
    float x = ball.peak - offset * offset;
#if KERNEL_POWER == 1
    float half_chord = sqrt(max(ball.peak, 0.0)) / ball.inverse;
    float to_entry = ball.middle - half_chord - at, to_exit = ball.middle + half_chord - at;
    if (to_entry > 0.0)
        value.next_kink = min(value.next_kink, at + to_entry);
    if (to_exit > 0.0)
        value.next_kink = min(value.next_kink, at + to_exit);
    if (ball.peak <= 0.0 || to_entry > 0.0 || to_exit <= 0.0)
        return;
    x = max(x, 1e-30);
#else
    if (x <= 0.0)
        return;
#endif
    value.field += ball.weight * kernel_value(x);
    value.slope -= 2.0 * ball.weight * kernel_derivative(x) * offset * ball.inverse;
}

LeafValue leaf_value(Leaf leaf, float at) {
    LeafValue value = LeafValue(0.0, 0.0, FAR);
    if (met_count <= uint(MET_LENGTH)) {
        for (uint i = 0u; i < min(met_count, uint(MET_LENGTH)); i++)
            leaf_add(value, LeafBall(met[i].x, met[i].y, met[i].z, met[i].w), at);
    } else {
        for (uint i = 0u; i < min(leaf.count, MOST_ENTRIES); i++)
            leaf_add(value, leaf_ball(leaf, leaf.first + i), at);
    }
    return value;
}

// Where the field first crosses the isovalue within `reach` of the middle of the stretch: with g the distance to the isovalue, s
// the slope towards it and M a bound of the second derivative, not before 2 g / (s + sqrt(s^2 + 2 M g)).
bool leaf_walk(Leaf leaf, float reach, float bend, bool is_inside, out float at) {
    float side = is_inside ? -1.0 : 1.0;
    at = -reach;
    for (uint i = 0u; i < MOST_STEPS; i++) {
        LeafValue value = leaf_value(leaf, at);
        float gap = side * (isovalue - value.field), slope = side * value.slope;
        if (gap <= 0.0)
            return true;
        float root = sqrt(slope * slope + 2.0 * bend * gap);
        float step = slope > 0.0 ? 2.0 * gap / (slope + root) : (root - slope) / bend;
        float next = min(at + step, max(value.next_kink, at + max(abs(at) * 1.2e-7, 1e-37)));
        if (next > reach)
            return false;
        bool is_there = gap <= CLOSE * isovalue || next == at;
        at = next;
        if (is_there)
            return true;
    }
    return false;
}

// Whether the field is above the isovalue where the projections of the centres onto the ray are on average, each weighted by what it
// adds there: if the ray meets the fluid, then most likely in this place (section 3).
bool leaf_is_fluid_at_projections(Leaf leaf, float reach) {
    float moments = 0.0, shares = 0.0;
    for (uint i = 0u; i < min(met_count, uint(MET_LENGTH)); i++) {
        float share = met[i].w * kernel_value(met[i].x);
        moments += share * met[i].y;
        shares += share;
    }
    return shares > 0.0 && leaf_value(leaf, clamp(moments / shares, -reach, reach)).field >= isovalue;
}

// A part of a segment.
struct LeafStretch {
    vec3 start; // of the segment
    vec3 direction;
    float enter; // distances along it
    float exit;
};

// Where a segment crosses the surface between two distances, any crossing where `takes_any`.
bool leaf_crossing(LeafStretch stretch, uint first, uint count, bool is_inside, bool takes_any, out float t) {
    t = stretch.enter;
    float begin = stretch.enter, longest = stretch.exit - stretch.enter;
    for (uint i = 0u; i < MOST_STEPS; i++) {
        float end = begin + longest < stretch.exit ? begin + longest : stretch.exit;
        float middle = 0.5 * (begin + end), reach = 0.5 * (end - begin), at;
        Leaf leaf = Leaf(first, count, stretch.start + middle * stretch.direction, stretch.direction);
        LeafBounds bounds = leaf_gather(leaf, reach, is_inside);
        if (is_inside || bounds.most >= isovalue * (1.0 - CLOSE)) {
            if (reach * bounds.sharpest > LONGEST) {
                longest *= 0.5;
                continue;
            }
            if (takes_any && !is_inside && leaf_is_fluid_at_projections(leaf, reach)) {
                t = middle;
                return true;
            }
            if (leaf_walk(leaf, reach, bounds.bend, is_inside, at)) {
                t = clamp(middle + at, begin, end);
                return true;
            }
        }
        if (end == stretch.exit)
            return false;
        begin = end;
        longest *= 2.0;
    }
    return false;
}
