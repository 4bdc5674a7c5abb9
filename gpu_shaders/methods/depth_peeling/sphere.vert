// Two triangles around each sphere. With FROM_PAIRS for each pair of a ball and a cell: the part of the ball's rectangle in that
// cell. Else for each ball. Six vertices each: drivers do badly with instances of so few.
#include "lib/ball.glsl"
#include "lib/sphere_bounds.glsl"
#include "lib/triangles.glsl"
#include "methods/depth_peeling/state.glsl"
#if FROM_PAIRS
#include "methods/depth_peeling/cells.glsl"

uniform usamplerBuffer pairs_tx; // ball, cell
#endif

flat out uint v_id;
flat out vec4 v_sphere;  // as in sphere_tx
flat out vec2 v_density; // as in density_tx

#if STARTS_ONLY
uniform float farthest_start; // scaled: the greatest distance at which a ray starts
#endif

// Whether the pass is about this ball at all.
bool is_drawn(Ball ball, vec2 density) {
#if KERNEL_SPHERES
    return density.y > 0.0;
#elif STARTS_ONLY
    return density.x < 0.0 || sphere_nearest(ball.center, ball.radius) * depth_scale <= farthest_start;
#else
    return true;
#endif
}

void main() {
    int index = gl_VertexID / 6;
#if FROM_PAIRS
    uvec2 pair = texelFetch(pairs_tx, index).xy;
    v_id = pair.x;
#else
    v_id = uint(index);
#endif
    Ball ball = ball_fetch(v_id);
    v_density = ball_density(v_id);
    v_sphere = vec4(ball.center, ball.radius);
#if KERNEL_SPHERES
    float radius = v_density.y;
#else
    float radius = ball.radius;
#endif
    vec4 rectangle = sphere_rectangle(ball.center, radius);
#if FROM_PAIRS
    uint level = cell_level(pair.y);
    vec2 cell = vec2(cell_position(pair.y)) * cell_size(level);
    rectangle = vec4(max(rectangle.xy, cell), min(rectangle.zw, cell + cell_size(level)));
#endif
    // Where nothing is to be drawn all corners fall together.
    vec2 corner = is_drawn(ball, v_density) ? square_corner(gl_VertexID % 6) : vec2(0.0);
    vec2 position = mix(rectangle.xy, max(rectangle.zw, rectangle.xy), corner) / image_middle - 1.0;
    // A little nearer than any crossing: fragments may be dropped early by this depth.
    float depth = clamp(sphere_nearest(ball.center, radius) * depth_scale, 0.0, 1.0);
    gl_Position = vec4(position, max(2.0 * depth - 1.0 - 1e-6, -1.0), 1.0);
}
