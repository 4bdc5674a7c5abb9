// Chooses for each ball the level of cells that it is drawn by: the first of which at most CELLS_ACROSS lie across it.
#include "lib/ball.glsl"
#include "lib/sphere_bounds.glsl"
#include "methods/depth_peeling/state.glsl"
#include "methods/depth_peeling/cells.glsl"

flat out uint v_id;
flat out uint v_level;
flat out ivec4 v_cells;  // low corner, high corner; inclusive
flat out vec2 v_reach;   // nearest and farthest distance, scaled

void main() {
    v_id = uint(gl_VertexID);
    Ball ball = ball_fetch(v_id);
    vec4 rectangle = sphere_rectangle(ball.center, ball.radius);
    bool is_seen = all(lessThan(rectangle.xy, rectangle.zw));
    v_level = WHOLE_IMAGE;
    v_cells = ivec4(0, 0, is_seen ? 0 : -1, is_seen ? 0 : -1);
#if TILING
    for (uint level = 0u; level < WHOLE_IMAGE && is_seen && v_level == WHOLE_IMAGE; level++) {
        ivec4 cells = cells_around(rectangle, level);
        if (all(lessThan(cells.zw - cells.xy, ivec2(CELLS_ACROSS)))) {
            v_level = level;
            v_cells = cells;
        }
    }
#endif
    v_reach = depth_scale * vec2(sphere_nearest(ball.center, ball.radius), sphere_farthest(ball.center, ball.radius));
}
