// Balls that lie one after the other, of whatever holds them, and the field of their sum. Who includes this gives
//   vec4 leaf_sphere(uint entry)    the centre in scene coordinates, and the influence radius R
//   float leaf_weight(uint entry)
#include "lib/kernel.glsl"

uniform float isovalue;

// Such balls as a stretch of a segment sees them.
struct Leaf {
    uint first;
    uint count;
    vec3 point; // the middle of the stretch
    vec3 direction;
};

// A ball on the stretch: x(t) = peak - ((t - middle) * inverse)^2, t counts from the middle of the stretch.
struct LeafBall {
    float peak;
    float middle;
    float inverse; // of R
    float weight;
};

LeafBall leaf_ball(Leaf leaf, uint entry) {
    vec4 sphere = leaf_sphere(entry);
    vec3 to_center = sphere.xyz - leaf.point;
    float inverse = 1.0 / sphere.w;
    float along = dot(to_center, leaf.direction);
    vec3 apart = (to_center - along * leaf.direction) * inverse;
    return LeafBall(1.0 - dot(apart, apart), along, inverse, leaf_weight(entry));
}

bool leaf_contains(uint first, uint count, vec3 point) {
    float field = 0.0;
    for (uint i = 0u; i < min(count, MOST_ENTRIES); i++) {
        vec4 sphere = leaf_sphere(first + i);
        vec3 apart = (point - sphere.xyz) / sphere.w;
        field += leaf_weight(first + i) * kernel_value(1.0 - dot(apart, apart));
    }
    return field >= isovalue;
}
