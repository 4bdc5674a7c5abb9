// Two triangles around each influence sphere: the rectangle between the tangents from the eye (Kanamori et al. 2008,
// appendix B), written with directions so that spheres that reach behind the eye come out right as well.
#include "lib/ball.glsl"

flat out uint v_id;

const float UNBOUNDED = 1e30;

// Where the sphere begins and ends along one axis, in units of the camera's window.
vec2 sphere_extent(float coordinate, float depth, float radius) {
    if (!is_perspective)
        return vec2(coordinate - radius, coordinate + radius);
    float tangent_2 = coordinate * coordinate + (depth - radius) * (depth + radius);
    if (tangent_2 <= 0.0)
        return vec2(-UNBOUNDED, UNBOUNDED);
    float tangent = sqrt(tangent_2);
    vec2 forward = depth * tangent + coordinate * radius * vec2(1.0, -1.0);
    vec2 across = coordinate * tangent + depth * radius * vec2(-1.0, 1.0);
    return vec2(forward.x > 0.0 ? across.x / forward.x : -UNBOUNDED, forward.y > 0.0 ? across.y / forward.y : UNBOUNDED);
}

void main() {
    v_id = uint(gl_VertexID) / 6u;
    Ball ball = ball_fetch(v_id);
    vec2 extent_x = sphere_extent(ball.center.x, -ball.center.z, ball.radius);
    vec2 extent_y = sphere_extent(ball.center.y, -ball.center.z, ball.radius);
    // The corners of two triangles: 0 1 2, 2 1 3.
    uint corner = uint(gl_VertexID) % 6u;
    corner = corner < 3u ? corner : corner == 3u ? 2u : corner == 4u ? 1u : 3u;
    bool right = (corner & 1u) == 1u, top = corner >= 2u;
    vec2 window = vec2(right ? extent_x.y : extent_x.x, top ? extent_y.y : extent_y.x);
    // A tenth of a pixel wider: rounding may not lose a pixel centre.
    vec2 margin = 0.1 * pixel_size * vec2(right ? 1.0 : -1.0, top ? 1.0 : -1.0);
    vec2 position = (window + margin - window_middle) / (pixel_size * image_middle);
    gl_Position = vec4(clamp(position, -1.0, 1.0), 0.0, 1.0);
}
