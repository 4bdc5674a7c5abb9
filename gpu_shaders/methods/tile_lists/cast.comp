// Casts the ray of each pixel: a group of threads for 8 x 4 pixels, in squares of 4 x 4. Larger groups would hold their memory until
// the slowest ray is done.
#include "methods/tile_lists/crowd.glsl"

layout(local_size_x = 32) in;

layout(r32f, binding = 0) uniform image2D depth_image;
layout(rgba32f, binding = 1) uniform image2D normal_image; // w: -1 where a ray that goes on is inside the fluid
#if WITH_COLORS
layout(rgba32f, binding = 2) writeonly uniform image2D color_image;
layout(std430, binding = 13) readonly buffer Colors {
    float colors[];
};
#endif
#if WITH_VELOCITIES
layout(rgba32f, binding = 3) writeonly uniform image2D velocity_image;
layout(std430, binding = 14) readonly buffer Velocities {
    float velocities[];
};
#endif
#if WITH_BALLS
layout(r32i, binding = 4) writeonly uniform iimage2D ball_image;
layout(std430, binding = 15) readonly buffer Numbers {
    int numbers[];
};
#endif

uniform ivec2 image_size;
uniform vec2 clip_distances; // planar
uniform vec2 slab;           // rays are searched between these distances
uniform bool goes_on;        // and were before
uniform mat3 world_from_view;

// What the balls give at the surface.
struct Shade {
    vec3 outward; // against the gradient, view space
    vec3 color;
    vec3 velocity;
    float total;
    float greatest;
    int ball;
};

void add_shade(inout Shade shade, vec3 direction, uint place, float t) {
    vec4 sphere = seen[place].sphere;
    Ball ball = Ball(sphere.xyz, sphere.w);
    Chord chord = ball_chord(ball, own_ray);
    float from_middle = (t - chord.middle) / chord.radius;
    float x = chord.peak - from_middle * from_middle;
    if (x <= 0.0)
        return;
    float weight = weight_of(place);
    // From the centre to the middle of the chord, then along the chord: nothing large is subtracted.
    vec2 offset = ball_offset(ball, own_ray);
    vec3 to_middle = direction * (dot(offset, own_ray.slope) / own_ray.stretch) - vec3(offset, 0.0);
    shade.outward += weight * kernel_derivative(x) / chord.radius * (to_middle / chord.radius + direction * from_middle);
    float share = max(weight * kernel_value(x), 0.0);
    uint id = seen[place].id;
#if WITH_COLORS
    shade.color += share * vec3(colors[3u * id], colors[3u * id + 1u], colors[3u * id + 2u]);
#endif
#if WITH_VELOCITIES
    shade.velocity += share * vec3(velocities[3u * id], velocities[3u * id + 1u], velocities[3u * id + 2u]);
#endif
    shade.total += share;
    if (share > shade.greatest) {
        shade.greatest = share;
#if WITH_BALLS
        shade.ball = numbers[id];
#endif
    }
}

Shade shade_at(vec3 direction, float t, bool is_crowded) {
    Shade shade = Shade(vec3(0.0), vec3(0.0), vec3(0.0), 0.0, 0.0, -1);
    if (!is_crowded) {
        for (uint i = 0u; i < min(listed_count, uint(LIST_LENGTH)); i++)
            add_shade(shade, direction, listed[i], t);
        return shade;
    }
    for (int level = 0; level < TILE_LEVELS; level++) {
        uint entry_count = streams[level].end;
        for (uint entry = crowd_starts[level]; entry < entry_count; entry++) {
            if (key_distance(entries[entry].x) > t)
                break;
            add_shade(shade, direction, entries[entry].y, t);
        }
    }
    return shade;
}

// Goes along a ray to the surface; true where there is one before `end`, then `t` is there.
bool cast_ray(inout float t, float end, out bool is_crowded) {
    is_crowded = false;
    for (int level = 0; level < TILE_LEVELS; level++)
        crowd_starts[level] = streams[level].next;
    take_in(t, 0u);
    float density = next_front() < t ? crowd_at(t, 0.0).density : density_at(t).x;
    if (!goes_on && density > isovalue)
        side = -1.0;
    drop_before(t);
    for (uint i = 0u; i < MOST_WINDOWS && t < end; i++) {
        float front = next_front();
        if (listed_count == 0u) {
            if (front == FAR)
                return false;
            t = max(t, front);
        }
        // Beyond `t` also where the radius is lost in its rounding: the next ball must be taken in.
        float limit = front == FAR ? t : t + max(0.5 * seen[next_place()].sphere.w, abs(t) * EPSILON);
        take_in(limit, 2u);
        front = next_front();
        if (listed_count == uint(LIST_LENGTH) && front <= t) {
            is_crowded = true;
            return walk_in_crowd(t, end);
        }
        float horizon = min(min(front, max(bounds.last_exit, limit)), end);
        if (listed_count > 0u && (side < 0.0 || bounds.density >= isovalue)) {
            if (side > 0.0)
                t = next_possible(t, horizon);
            if (walk_to(t, horizon))
                return true;
        }
        t = max(t, horizon);
        drop_before(t);
    }
    return false;
}

void put(ivec2 pixel, float depth, vec3 normal, Shade shade) {
    float share = shade.total > 0.0 ? 1.0 / shade.total : 0.0;
    imageStore(depth_image, pixel, vec4(depth));
    imageStore(normal_image, pixel, vec4(normal, side));
#if WITH_COLORS
    imageStore(color_image, pixel, vec4(shade.color * share, 0.0));
#endif
#if WITH_VELOCITIES
    imageStore(velocity_image, pixel, vec4(shade.velocity * share, 0.0));
#endif
#if WITH_BALLS
    imageStore(ball_image, pixel, ivec4(shade.ball));
#endif
}

void main() {
    uint own = gl_LocalInvocationIndex;
    ivec2 inside = ivec2((own & 3u) | (own >> 2u & 4u), own >> 2u & 3u);
    ivec2 pixel = ivec2(gl_WorkGroupID.xy) * ivec2(8, 4) + inside;
    if (any(greaterThanEqual(pixel, image_size)) || !lists_fit())
        return;
    if (goes_on) {
        if (imageLoad(depth_image, pixel).x < DEPTH_BACKGROUND)
            return;
        side = imageLoad(normal_image, pixel).w;
    }
    take_ray(vec2(pixel) + 0.5);
    vec3 direction = vec3(own_ray.slope, -1.0) / own_ray.stretch;
    visible_end = uintBitsToFloat(occlusion[occlusion_index(0, pixel / CELL_SIZE)]);
    open_streams(pixel);
    float t = max(clip_distances.x * own_ray.stretch, slab.x), end = min(clip_distances.y * own_ray.stretch, slab.y);
    bool is_crowded = false;
    Shade shade = Shade(vec3(0.0), vec3(0.0), vec3(0.0), 0.0, 0.0, -1);
    if (!cast_ray(t, end, is_crowded)) {
        put(pixel, DEPTH_BACKGROUND, vec3(0.0), shade);
    } else {
        shade = shade_at(direction, t, is_crowded);
        float steepness = length(shade.outward);
        // Where the density is level, which has no normal, the one that faces along the ray.
        vec3 normal = steepness > 0.0 ? shade.outward / steepness : -side * direction;
        put(pixel, min(t / own_ray.stretch, DEPTH_BACKGROUND), world_from_view * normal, shade);
    }
    if (is_crowded)
        atomicAdd(counts.crowded_count, 1u);
}
