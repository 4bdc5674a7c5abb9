// The discs that particles draw, and where rays meet them (section 7.6; there they are flat and only their normals bend).
#include "lib/scene_camera.glsl"

uniform vec2 clip_depths; // planar, from the anchor

// A disc says nothing where the surface would have turned away from its middle by more than this cosine.
uniform float least_cosine;

struct Disc {
    vec3 position; // scene coordinates
    vec3 normal;   // unit, out of the fluid
    mat3 bend;     // the surface is normal . x + x bend x / 2 = 0, x from the position
    float radius;
};

struct Meeting {
    bool is_met;
    float t;      // along the ray, from the anchor's plane
    vec3 normal;  // unit
    float weight; // in the blend, at most 1
};

Disc disc_unpack(vec4 place, vec4 normal, vec4 along, vec4 across) {
    mat3 bend = mat3(along.x, across.x, across.y, across.x, along.y, across.z, across.y, across.z, along.z);
    return Disc(place.xyz, normal.xyz, bend, along.w);
}

// The smaller root first; both are far away where there is none.
vec2 disc_roots(float square, float linear, float constant) {
    const float NOWHERE = 3e38;
    float rest = linear * linear - 2.0 * square * constant;
    if (rest < 0.0)
        return vec2(NOWHERE);
    float sum = -(linear + (linear < 0.0 ? -1.0 : 1.0) * sqrt(rest));
    vec2 roots = vec2(square != 0.0 ? sum / square : NOWHERE, sum != 0.0 ? 2.0 * constant / sum : 0.0);
    return vec2(min(roots.x, roots.y), max(roots.x, roots.y));
}

// Where a ray meets the face of a disc that looks at it, or away where the ray starts inside the fluid.
Meeting disc_meeting(Disc disc, Ray ray, bool starts_inside) {
    vec3 direction = scene_direction(ray), offset = scene_start(ray) - disc.position;
    float middle = -dot(offset, direction);
    vec3 nearest = offset + middle * direction;
    vec3 bent = disc.bend * direction;
    float square = dot(direction, bent), linear = dot(disc.normal, direction) + dot(nearest, bent);
    float constant = dot(disc.normal, nearest) + 0.5 * dot(nearest, disc.bend * nearest);
    vec2 roots = disc_roots(square, linear, constant);
    for (int i = 0; i < 2; i++) {
        float t = middle + roots[i];
        vec3 place = nearest + roots[i] * direction;
        vec3 normal = disc.normal + disc.bend * place;
        float share = dot(place, place) / (disc.radius * disc.radius);
        float depth = t / ray.stretch;
        bool is_between = depth >= clip_depths.x && depth <= clip_depths.y;
        bool is_near = share < 1.0 && dot(normal, disc.normal) > least_cosine * length(normal);
        if (is_near && is_between && (dot(normal, direction) > 0.0) == starts_inside)
            return Meeting(true, t, normalize(normal), (1.0 - share) * (1.0 - share));
    }
    return Meeting(false, 0.0, vec3(0.0), 0.0);
}
