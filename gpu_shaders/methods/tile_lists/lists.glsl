// The balls that a ray may meet next, from the lists of its tiles on all levels; and those that it is in, or soon will be.
#define ENTRIES_ACCESS readonly
#include "lib/kernel.glsl"
#include "methods/tile_lists/occlusion.glsl"
#include "methods/tile_lists/tiles.glsl"
#include "methods/tile_lists/seen.glsl"
#include "methods/tile_lists/entries.glsl"

#if WITH_WEIGHTS
layout(std430, binding = 2) readonly buffer Weights {
    float weights[];
};
#else
uniform float weight_of_all;
#endif
layout(std430, binding = 8) readonly buffer SeenBalls {
    Seen seen[];
};
layout(std430, binding = 9) readonly buffer TileEnds {
    uint tile_ends[];
};
layout(std430, binding = 10) readonly buffer TileStarts {
    uint tile_starts[];
};

const float FAR = 3e38;

float weight_of(uint place) {
#if WITH_WEIGHTS
    return weights[seen[place].id];
#else
    return weight_of_all;
#endif
}

// What is left of a tile's list.
struct Stream {
    uint next;
    uint end;
    uint place;  // of the next ball
    float front; // of the next ball, FAR where there is none
};

Stream streams[TILE_LEVELS];
float visible_end = FAR; // what begins behind this is hidden

void look_ahead(inout Stream stream) {
    stream.front = FAR;
    if (stream.next >= stream.end)
        return;
    uvec2 entry = entries[stream.next];
    float front = key_distance(entry.x);
    stream.place = entry.y;
    if (front < visible_end)
        stream.front = front;
}

void open_streams(ivec2 pixel) {
    for (int level = 0; level < TILE_LEVELS; level++) {
        int tile = tile_number(level, pixel >> TILE_SHIFTS[level]);
        streams[level].next = tile_starts[tile];
        streams[level].end = tile_ends[tile];
        look_ahead(streams[level]);
    }
}

float next_front() {
    return min(min(streams[0].front, streams[1].front), min(streams[2].front, streams[3].front));
}

// The place of the ball that begins next; there must be one.
uint next_place() {
    float front = next_front();
    return streams[0].front == front   ? streams[0].place
           : streams[1].front == front ? streams[1].place
           : streams[2].front == front ? streams[2].place
                                       : streams[3].place;
}

void skip_next() {
    float front = next_front();
    bool is_done = false;
    for (int level = 0; level < TILE_LEVELS; level++) {
        if (!is_done && streams[level].front == front) {
            streams[level].next++;
            look_ahead(streams[level]);
            is_done = true;
        }
    }
}

// What no sum along the ray exceeds: the density, and how fast its slope rises and falls.
struct Bounds {
    float density;
    float rise;
    float fall;
    float least_radius;
    float last_exit;
};

const Bounds NO_BOUNDS = Bounds(0.0, 0.0, 0.0, FAR, -FAR);

struct Listed {
    float peak;
    float middle;
    float radius;
    float weight;
};

// Only where the balls are: memory that a thread has for itself is slower than to find the chord again.
uint listed[LIST_LENGTH];
uint listed_count = 0u;
Bounds bounds = NO_BOUNDS;
Ray own_ray;

void take_ray(vec2 pixel) {
    own_ray = ray_from_pixel(pixel);
}

Listed ball_on_ray(uint place) {
    vec4 sphere = seen[place].sphere;
    Chord chord = ball_chord(Ball(sphere.xyz, sphere.w), own_ray);
    return Listed(chord.peak, chord.middle, chord.radius, weight_of(place));
}

float half_chord(Listed ball) {
    return ball.radius * sqrt(max(ball.peak, 0.0));
}

void add_bounds(Listed ball) {
    float pull = abs(ball.weight) / ball.radius / ball.radius;
    float up = pull * kernel_steepest_rise(ball.peak), down = pull * kernel_steepest_fall(ball.peak);
    bounds.density += max(ball.weight, 0.0) * kernel_value(ball.peak);
    bounds.rise += ball.weight < 0.0 ? down : up;
    bounds.fall += ball.weight < 0.0 ? up : down;
    bounds.least_radius = min(bounds.least_radius, ball.radius);
    bounds.last_exit = max(bounds.last_exit, ball.middle + half_chord(ball));
}

// Takes in the balls that begin before `limit`, and more until there are `least`; fewer where the list is full.
void take_in(float limit, uint least) {
    for (uint i = 0u; i < MOST_ENTRIES; i++) {
        float front = next_front();
        if (front == FAR || (front >= limit && listed_count >= least) || listed_count == uint(LIST_LENGTH))
            return;
        uint place = next_place();
        skip_next();
        Listed ball = ball_on_ray(place);
        if (ball.peak > 0.0) {
            add_bounds(ball);
            listed[listed_count] = place;
            listed_count++;
        }
    }
}

// Forgets the balls that the ray has left before `t`.
void drop_before(float t) {
    uint kept_count = 0u;
    bounds = NO_BOUNDS;
    for (uint i = 0u; i < min(listed_count, uint(LIST_LENGTH)); i++) {
        Listed ball = ball_on_ray(listed[i]);
        if (ball.middle + half_chord(ball) > t) {
            add_bounds(ball);
            listed[kept_count] = listed[i];
            kept_count++;
        }
    }
    listed_count = kept_count;
}
