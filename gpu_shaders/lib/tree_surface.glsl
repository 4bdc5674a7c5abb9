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

#include "lib/leaf_surface.glsl"

LeafSurface tree_surface(Segment segment, TreeHit hit) {
    // Where the field is level, which has no normal, the one that faces along the ray.
    vec3 level = segment.direction * (hit.is_inside ? 1.0 : -1.0);
    return leaf_surface(hit.first, hit.count, segment.start + hit.t * segment.direction, level);
}
