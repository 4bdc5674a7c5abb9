// Two triangles around each ball, at the depth of its nearest point; with KERNEL_SPHERES around its kernel sphere. A ball that
// reaches no distance that the pixels around it ask for is not drawn (Mishima et al. 2008, section 4.3): its corners fall together.
#include "lib/ball.glsl"
#include "lib/sphere_bounds.glsl"
#include "lib/triangles.glsl"
#include "lib/cells.glsl"
#include "lib/sampling/samples.glsl"

flat out uint v_id;
flat out vec4 v_sphere;  // as in sphere_tx
flat out vec2 v_density; // as in density_tx

// Cells that are looked up along each side of a rectangle, at most.
const int CELLS_ACROSS = 3;

bool is_asked_for(vec4 rectangle, float nearest, float farthest) {
    uint level = 0u;
    ivec4 cells = cells_around(rectangle, level);
    for (uint coarser = 1u; coarser <= WHOLE_IMAGE && any(greaterThanEqual(cells.zw - cells.xy, ivec2(CELLS_ACROSS))); coarser++) {
        level = coarser;
        cells = cells_around(rectangle, level);
    }
    vec2 range = EMPTY_RANGE;
    for (int y = 0; y < CELLS_ACROSS; y++)
        for (int x = 0; x < CELLS_ACROSS; x++)
            range = range_join(range, cell_range(level, min(cells.xy + ivec2(x, y), cells.zw)));
    return !range_is_empty(range) && farthest >= range.x && nearest <= range.y;
}

void main() {
    v_id = uint(gl_VertexID / 6);
    Ball ball = ball_fetch(v_id);
    v_density = ball_density(v_id);
    v_sphere = vec4(ball.center, ball.radius);
#if KERNEL_SPHERES
    float radius = v_density.y;
#else
    float radius = ball.radius;
#endif
    vec4 rectangle = sphere_rectangle(ball.center, radius);
    float nearest = sphere_nearest(ball.center, radius) * depth_scale;
    bool is_drawn = radius > 0.0 && all(lessThan(rectangle.xy, rectangle.zw));
#if BALL_CULLING
    if (is_drawn)
        is_drawn = is_asked_for(rectangle, nearest, sphere_farthest(ball.center, radius) * depth_scale);
#endif
    vec2 corner = is_drawn ? square_corner(gl_VertexID % 6) : vec2(0.0);
    vec2 position = mix(rectangle.xy, rectangle.zw, corner) / image_middle - 1.0;
    // A little nearer than the ball: fragments may be dropped early by this depth.
    float depth = 2.0 * clamp(nearest, 0.0, 1.0) - 1.0 - 1e-6;
    gl_Position = vec4(position, max(depth, -1.0), 1.0);
}
