// Keeps the balls that may be seen, and counts them in the tiles that may see them.
#include "lib/sphere_bounds.glsl"
#include "methods/tile_lists/balls.glsl"
#include "methods/tile_lists/occlusion.glsl"
#include "methods/tile_lists/tiles.glsl"
#include "methods/tile_lists/seen.glsl"

layout(local_size_x = THREADS) in;

layout(std430, binding = 8) writeonly buffer SeenBalls {
    Seen seen[];
};
layout(std430, binding = 9) buffer TileCounts {
    uint tile_counts[]; // of entries
};

uniform vec2 clip_distances; // planar

shared uint kept_count;
shared uint first_place;

// Counts the ball in its tiles; false where it cannot be seen.
bool count_in_tiles(Ball ball, out Seen result) {
    vec4 rectangle = sphere_rectangle(ball.center, ball.radius);
    float depth = -ball.center.z;
    bool is_between = depth + ball.radius > clip_distances.x && depth - ball.radius < clip_distances.y;
    // The pixels whose centres lie in the rectangle.
    ivec2 first = ivec2(ceil(rectangle.xy - 0.5)), last = ivec2(floor(rectangle.zw - 0.5));
    if (!is_between || any(lessThan(last, first)))
        return false;
    float front = sphere_nearest(ball.center, ball.radius);
    if (front >= occlusion_farthest(first / CELL_SIZE, last / CELL_SIZE))
        return false;
    ivec2 span = last - first;
    int level = tile_level(max(span.x, span.y) + 1);
    ivec2 first_tile = first >> TILE_SHIFTS[level], last_tile = last >> TILE_SHIFTS[level];
    bool is_seen = false;
    for (int y = first_tile.y; y <= min(last_tile.y, LARGEST_SIDE); y++) {
        for (int x = first_tile.x; x <= min(last_tile.x, LARGEST_SIDE); x++) {
            if (tile_sees(level, ivec2(x, y), front)) {
                atomicAdd(tile_counts[tile_number(level, ivec2(x, y))], 1u);
                is_seen = true;
            }
        }
    }
    result = Seen(vec4(ball.center, ball.radius), 0u, front, pack_first(first_tile), pack_last(last_tile, level));
    return is_seen;
}

void main() {
    if (gl_LocalInvocationIndex == 0u)
        kept_count = 0u;
    memoryBarrierShared();
    barrier();
    uint id = thread_number();
    Seen own;
    bool is_seen = id < ball_count && count_in_tiles(ball_in_view(min(id, ball_count - 1u)), own);
    uint place = is_seen ? atomicAdd(kept_count, 1u) : 0u;
    memoryBarrierShared();
    barrier();
    if (gl_LocalInvocationIndex == 0u)
        first_place = kept_count > 0u ? atomicAdd(counts.seen_count, kept_count) : 0u;
    memoryBarrierShared();
    barrier();
    if (is_seen && first_place + place < seen_capacity) {
        own.id = id;
        seen[first_place + place] = own;
    }
}
