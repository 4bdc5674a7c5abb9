// What balls that lie one after the other give at the surface. WITH_COLORS, WITH_VELOCITIES, WITH_BALLS: what of it is wanted. Beside
// what lib/leaf_ball.glsl asks for, who includes this gives
//   uint leaf_id(uint entry)        the ball's number
//   vec3 ball_color(uint id), vec3 ball_velocity(uint id)    where they are wanted
#include "lib/leaf_ball.glsl"

struct LeafSurface {
    vec3 normal;     // unit, out of the fluid
    float steepness; // of the field
    float radius;    // of the ball with the greatest share
    int ball;        // its number
    vec3 color;
    vec3 velocity;
};

// `level`: the normal where the field is level.
LeafSurface leaf_surface(uint first, uint count, vec3 point, vec3 level) {
    LeafSurface surface = LeafSurface(vec3(0.0), 0.0, 1.0, -1, vec3(0.0), vec3(0.0));
    float total = 0.0, greatest = 0.0;
    for (uint i = 0u; i < min(count, MOST_ENTRIES); i++) {
        uint entry = first + i;
        vec4 sphere = leaf_sphere(entry);
        vec3 away = (point - sphere.xyz) / sphere.w;
        float x = 1.0 - dot(away, away);
        if (x <= 0.0)
            continue;
        float weight = leaf_weight(entry);
        surface.normal += weight * kernel_derivative(x) / sphere.w * away;
        float share = max(weight * kernel_value(x), 0.0);
        uint id = leaf_id(entry);
#if WITH_COLORS
        surface.color += share * ball_color(id);
#endif
#if WITH_VELOCITIES
        surface.velocity += share * ball_velocity(id);
#endif
        total += share;
        if (share > greatest) {
            greatest = share;
            surface.ball = int(id);
            surface.radius = sphere.w;
        }
    }
    float pull = length(surface.normal);
    surface.steepness = 2.0 * pull;
    surface.normal = pull > 0.0 ? surface.normal / pull : level;
    surface.color /= max(total, 1e-30);
    surface.velocity /= max(total, 1e-30);
    return surface;
}
