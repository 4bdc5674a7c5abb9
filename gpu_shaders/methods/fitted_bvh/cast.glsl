// The ray of a pixel, and what it finds.
#include "lib/fitted_bvh.glsl"

#if WITH_STORAGE
#if WITH_COLORS || WITH_VELOCITIES || WITH_BALLS
layout(std430, binding = 3) readonly buffer LeafIds {
    uint leaf_ids[];
};
#endif
#if WITH_COLORS
layout(std430, binding = 4) readonly buffer Colors {
    float colors[];
};
#endif
#if WITH_VELOCITIES
layout(std430, binding = 5) readonly buffer Velocities {
    float velocities[];
};
#endif
#else
#if WITH_COLORS || WITH_VELOCITIES || WITH_BALLS
uniform usamplerBuffer ids_tx;
#endif
uniform samplerBuffer colors_tx;
uniform samplerBuffer velocities_tx;
#endif

uniform mat3 world_from_view;
uniform vec3 anchor;        // on the camera's axis, not farther than the tree; scene coordinates
uniform float anchor_depth; // planar
uniform vec2 clip_depths;   // planar, less that of the anchor

struct Found {
    float depth;
    vec3 normal;
    vec3 color;
    vec3 velocity;
    int ball;
};

uint leaf_id(uint entry) {
#if !(WITH_COLORS || WITH_VELOCITIES || WITH_BALLS)
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

// What the balls of the leaf give at a point of the surface.
void gather_surface(inout Found found, Segment segment, TreeHit hit) {
    Leaf leaf = Leaf(hit.first, hit.count, segment.start + hit.t * segment.direction, segment.direction);
    vec3 outward = vec3(0.0);
    float total = 0.0, greatest = 0.0;
    for (uint i = 0u; i < min(leaf.count, MOST_ENTRIES); i++) {
        uint entry = leaf.first + i;
        vec4 sphere = leaf_sphere(entry);
        vec3 away = (leaf.point - sphere.xyz) / sphere.w;
        float x = 1.0 - dot(away, away);
        if (x <= 0.0)
            continue;
        float weight = leaf_weight(entry);
        outward += weight * kernel_derivative(x) / sphere.w * away;
        float share = max(weight * kernel_value(x), 0.0);
        uint id = leaf_id(entry);
#if WITH_COLORS
        found.color += share * ball_color(id);
#endif
#if WITH_VELOCITIES
        found.velocity += share * ball_velocity(id);
#endif
        total += share;
        if (share > greatest) {
            greatest = share;
            found.ball = int(id);
        }
    }
    float steepness = length(outward);
    // Where the field is level, which has no normal, the one that faces along the ray.
    found.normal = steepness > 0.0 ? outward / steepness : segment.direction * (hit.is_inside ? 1.0 : -1.0);
    found.color /= max(total, 1e-30);
    found.velocity /= max(total, 1e-30);
}

// From the anchor's plane on, so that what is large has been subtracted before, in double precision.
Found cast_pixel(vec2 pixel) {
    Ray ray = ray_from_pixel(pixel);
    vec3 across = is_perspective ? vec3(anchor_depth * ray.slope, 0.0) : vec3(ray.origin, 0.0);
    vec3 direction = world_from_view * (vec3(ray.slope, -1.0) / ray.stretch);
    Segment segment = segment_from(anchor + world_from_view * across, direction);
    Found found = Found(DEPTH_BACKGROUND, vec3(0.0), vec3(0.0), vec3(0.0), -1);
    TreeHit hit;
    if (tree_cast(segment, clip_depths.x * ray.stretch, clip_depths.y * ray.stretch, true, false, false, hit)) {
        gather_surface(found, segment, hit);
        found.depth = min(anchor_depth + hit.t / ray.stretch, DEPTH_BACKGROUND);
    }
    return found;
}
