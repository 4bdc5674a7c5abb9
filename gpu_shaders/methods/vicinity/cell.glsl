// Whose part of space a point is in: that of the ball with the least power |p - c|^2 - R^2. Every point of the fluid lies in the
// influence sphere of that ball, so it is enough if each ball searches its own part. Parts meet in planes: along a ray each is one
// interval, and the fragments of all balls share a ray among them instead of each searching all of its sphere.
#include "methods/vicinity/lists.glsl"
#include "lib/leaf_ball.glsl"

// Parts reach beyond the planes by so many radii: two balls must not both take a crossing for one of the other, as each finds the
// density by other roundings.
const float CELL_OVERLAP = 1e-3;
// The same as shares: of the squares of lengths that were added, and of the distance from the eye and from the scene's origin.
const float CELL_MARGIN = 4e-6;
const float CELL_ROUNDING = 2e-6;

// Cuts [begin, end] down to the part of the ball with the entry 0; false where nothing is left. The nearest neighbours cut most and
// come first in the list. `far`: how far coordinates on the ray are from where they count from.
bool cell_clip(Leaf leaf, LeafBall own, vec4 own_sphere, float far, inout float begin, inout float end) {
    // In radii of the ball, from its own middle.
    float scale = own.inverse;
    float first = (begin - own.middle) * scale, last = (end - own.middle) * scale;
    float low = first, high = last;
    float rounding = CELL_ROUNDING * far * scale;
    float overlap = CELL_OVERLAP + rounding;
    for (uint i = 1u; i < min(leaf.count, MOST_ENTRIES); i++) {
        vec4 sphere = leaf_sphere(i);
        // Of equal spheres the first has the part of all.
        if (sphere == own_sphere && leaf_place(i) < leaf_place(0u))
            return false;
        vec3 to_center = (sphere.xyz - leaf.point) * scale;
        float along = dot(to_center, leaf.direction);
        vec3 apart = to_center - along * leaf.direction;
        float radius = sphere.w * scale, delta = along - own.middle * scale;
        // 2 delta u <= square, where u is the distance from the own middle.
        float away_2 = dot(apart, apart), radius_2 = radius * radius;
        float square = delta * delta + own.peak + away_2 - radius_2;
        square += CELL_MARGIN * (1.0 + delta * delta + away_2 + radius_2) + rounding * (1.0 + radius);
        if (abs(delta) > 1e-6) {
            float plane = 0.5 * square / delta;
            if (delta > 0.0)
                high = min(high, plane);
            else
                low = max(low, plane);
        } else if (square < -1e-5) {
            return false;
        }
        if (low > high + 2.0 * overlap)
            return false;
    }
    // What is not cut stays what it is, to the last digit.
    if (low > first)
        begin = max(begin, own.middle + (low - overlap) / scale);
    if (high < last)
        end = min(end, own.middle + (high + overlap) / scale);
    return begin < end;
}
