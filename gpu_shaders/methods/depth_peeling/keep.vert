// Whether a pair's cell still asks for its ball.
#include "lib/ball.glsl"
#include "lib/sphere_bounds.glsl"
#include "methods/depth_peeling/state.glsl"
#include "methods/depth_peeling/cells.glsl"

uniform usamplerBuffer pairs_tx;

flat out uvec2 v_pair;
flat out int v_is_kept;

#if CELL_PHASE == 0
uniform float farthest_start; // scaled: the greatest distance at which a ray starts
#endif

// The greatest scaled distance at which the ball still matters.
float farthest(Ball ball) {
#if CELL_PHASE == 0
    return max(sphere_farthest_entry(ball.center, ball.radius) * depth_scale, farthest_start);
#else
    return sphere_farthest(ball.center, ball.radius) * depth_scale;
#endif
}

void main() {
    v_pair = texelFetch(pairs_tx, gl_VertexID).xy;
    Ball ball = ball_fetch(v_pair.x);
    float nearest = sphere_nearest(ball.center, ball.radius) * depth_scale;
    v_is_kept = int(cell_wants(cell_level(v_pair.y), cell_position(v_pair.y), nearest, farthest(ball)));
}
