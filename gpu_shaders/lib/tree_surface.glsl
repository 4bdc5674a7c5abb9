// What the balls of a leaf give at the surface. WITH_COLORS, WITH_VELOCITIES, WITH_BALLS: what of it is wanted.
#include "lib/fitted_bvh.glsl"

#define WITH_IDS (WITH_COLORS || WITH_VELOCITIES || WITH_BALLS)

#if WITH_STORAGE
#if WITH_IDS
layout(std430, binding = 3) readonly buffer LeafIds {
    uint leaf_ids[];
};
#endif
#if WITH_COLORS
layout(std430, binding = 4) readonly buffer Colors {
    float colors[]; // three a ball
};
#endif
#if WITH_VELOCITIES
layout(std430, binding = 5) readonly buffer Velocities {
    float velocities[];
};
#endif
#else
#if WITH_IDS
uniform usamplerBuffer ids_tx;
#endif
#if WITH_COLORS
uniform samplerBuffer colors_tx;
#endif
#if WITH_VELOCITIES
uniform samplerBuffer velocities_tx;
#endif
#endif

struct TreeSurface {
    vec3 normal;     // unit, out of the fluid
    float steepness; // of the field
    float radius;    // of the ball with the greatest share
    int ball;        // its number
    vec3 color;
    vec3 velocity;
};

uint leaf_id(uint entry) {
#if !WITH_IDS
    return 0u;
#elif WITH_STORAGE
    return leaf_ids[entry];
#else
    return texelFetch(ids_tx, int(entry)).x;
#endif
}

#if WITH_COLORS
vec3 ball_color(uint id) {
    uint at = 3u * id;
#if WITH_STORAGE
    return vec3(colors[at], colors[at + 1u], colors[at + 2u]);
#else
    return vec3(texelFetch(colors_tx, int(at)).x, texelFetch(colors_tx, int(at + 1u)).x, texelFetch(colors_tx, int(at + 2u)).x);
#endif
}
#endif

#if WITH_VELOCITIES
vec3 ball_velocity(uint id) {
    uint at = 3u * id;
#if WITH_STORAGE
    return vec3(velocities[at], velocities[at + 1u], velocities[at + 2u]);
#else
    return vec3(texelFetch(velocities_tx, int(at)).x, texelFetch(velocities_tx, int(at + 1u)).x,
                texelFetch(velocities_tx, int(at + 2u)).x);
#endif
}
#endif

TreeSurface tree_surface(Segment segment, TreeHit hit) {
    TreeSurface surface = TreeSurface(vec3(0.0), 0.0, 1.0, -1, vec3(0.0), vec3(0.0));
    vec3 point = segment.start + hit.t * segment.direction;
    float total = 0.0, greatest = 0.0;
    for (uint i = 0u; i < min(hit.count, MOST_ENTRIES); i++) {
        uint entry = hit.first + i;
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
    // Where the field is level, which has no normal, the one that faces along the ray.
    surface.normal = pull > 0.0 ? surface.normal / pull : segment.direction * (hit.is_inside ? 1.0 : -1.0);
    surface.color /= max(total, 1e-30);
    surface.velocity /= max(total, 1e-30);
    return surface;
}
