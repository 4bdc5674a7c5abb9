// The way of a ray that is in more balls at once than its list takes: the sums are made anew from the lists of the tiles at each
// step. Slow, and without a limit.
#include "methods/tile_lists/walk.glsl"

// Where the ray's balls begin in the lists: what comes before has ended.
uint crowd_starts[TILE_LEVELS];

// What the balls give at a distance; `next` is where others begin behind the window.
struct Crowd {
    float density;
    float slope;
    float bend;
    float next;
};

void add_to_crowd(inout Crowd crowd, Chord chord, float weight, float t, float window_end) {
    float half_length = chord_half_length(chord);
    float entry = chord.middle - half_length, exit = chord.middle + half_length;
    if (chord.peak <= 0.0 || exit <= t)
        return;
    if (entry > window_end) {
        crowd.next = min(crowd.next, entry);
        return;
    }
    float offset = (t - chord.middle) / chord.radius;
    float x = chord.peak - offset * offset;
    float slope = weight * kernel_derivative(x) * -2.0 * offset / chord.radius;
    crowd.density += weight * kernel_value(x);
    crowd.bend += abs(weight) * kernel_slope_change(chord.peak) / chord.radius / chord.radius;
#if KERNEL_POWER == 1
    // The slope jumps up where the ray enters a ball, and where it leaves one from a slope downwards.
    if (x <= 0.0)
        slope = max(weight, 0.0) * KERNEL_LOW * 2.0 * sqrt(chord.peak) / chord.radius;
    else if (weight > 0.0 && exit < window_end)
        slope = max(slope, 0.0);
#endif
    crowd.slope += slope;
}

Crowd crowd_at(float t, float window) {
    Crowd crowd = Crowd(0.0, 0.0, 0.0, FAR);
    for (int level = 0; level < TILE_LEVELS; level++) {
        bool is_start = true;
        uint entry_count = streams[level].end;
        for (uint entry = crowd_starts[level]; entry < entry_count; entry++) {
            uvec2 next = entries[entry];
            float front = key_distance(next.x);
            if (front > t + window || front >= visible_end) {
                crowd.next = min(crowd.next, front);
                break;
            }
            vec4 sphere = seen[next.y].sphere;
            Ball ball = Ball(sphere.xyz, sphere.w);
            // No ray leaves it later.
            bool has_ended = front + 2.0 * ball.radius + 1e-5 * (abs(front) + ball.radius) < t;
            is_start = is_start && has_ended;
            if (is_start)
                crowd_starts[level] = entry + 1u;
            else if (!has_ended)
                add_to_crowd(crowd, ball_chord(ball, own_ray), side * weight_of(next.y), t, t + window);
        }
    }
    return crowd;
}

// Walks from `t` to `end`; true where the surface is met, then `t` is there.
bool walk_in_crowd(inout float t, float end) {
    float window = seen[next_place()].sphere.w;
    for (uint i = 0u; i < MOST_STEPS && t < end; i++) {
        float resolution = max(abs(t) * 3e-7, TINY);
        Crowd crowd = crowd_at(t, window);
        float gap = side * isovalue - crowd.density;
        if (gap <= 0.0)
            return true;
        float divisor = crowd.slope + sqrt(crowd.slope * crowd.slope + 2.0 * crowd.bend * gap);
        float step = divisor > 0.0 ? 2.0 * gap / divisor : FAR;
        float advance = max(min(step, window), resolution);
        t += advance;
        // Where no ball is in the window either, on to the next one.
        if (step >= window && crowd.bend == 0.0)
            t = max(t, crowd.next);
        window = max(2.0 * min(step, window), resolution);
    }
    return false;
}
