// Where a sphere lies in the image and how far it is from the eye (Kanamori et al. 2008, section 5.1 and appendix B).
#include "lib/chord.glsl"

const float UNBOUNDED = 1e30;
// Rounding may not lose a pixel centre.
const float RECTANGLE_MARGIN = 0.1;

// Where a sphere begins and ends along one axis, in units of the camera's window: between the tangents from the eye, written
// with directions so that spheres that reach behind the eye come out right as well.
vec2 sphere_extent(float coordinate, float depth, float radius) {
    if (!is_perspective)
        return vec2(coordinate - radius, coordinate + radius);
#if TIGHT_RECTANGLES
    float tangent_2 = coordinate * coordinate + (depth - radius) * (depth + radius);
    if (tangent_2 <= 0.0)
        return vec2(-UNBOUNDED, UNBOUNDED);
    float tangent = sqrt(tangent_2);
    vec2 forward = depth * tangent + coordinate * radius * vec2(1.0, -1.0);
    vec2 across = coordinate * tangent + depth * radius * vec2(-1.0, 1.0);
    return vec2(forward.x > 0.0 ? across.x / forward.x : -UNBOUNDED, forward.y > 0.0 ? across.y / forward.y : UNBOUNDED);
#else
    // The picture of the cube around the sphere.
    if (depth <= radius)
        return vec2(-UNBOUNDED, UNBOUNDED);
    float low = coordinate - radius, high = coordinate + radius;
    return vec2(low / (low < 0.0 ? depth - radius : depth + radius), high / (high > 0.0 ? depth - radius : depth + radius));
#endif
}

// The pixels around a sphere: low corner, high corner; within the image.
vec4 sphere_rectangle(vec3 center, float radius) {
    vec2 extent_x = sphere_extent(center.x, -center.z, radius);
    vec2 extent_y = sphere_extent(center.y, -center.z, radius);
    vec4 window = vec4(extent_x.x, extent_y.x, extent_x.y, extent_y.y);
    vec4 pixels = (window - window_middle.xyxy) / pixel_size.xyxy + image_middle.xyxy;
    pixels += RECTANGLE_MARGIN * vec4(-1.0, -1.0, 1.0, 1.0);
    return clamp(pixels, vec4(0.0), 2.0 * image_middle.xyxy);
}

// The least distance of a sphere along any ray, not above the true one.
float sphere_nearest(vec3 center, float radius) {
    float to_center = is_perspective ? length(center) : -center.z;
    return to_center - radius - 1e-6 * (abs(to_center) + radius);
}

// The greatest distance at which any ray leaves a sphere, not below the true one.
float sphere_farthest(vec3 center, float radius) {
    float to_center = is_perspective ? length(center) : -center.z;
    return to_center + radius + 1e-6 * (abs(to_center) + radius);
}

// The greatest distance at which any ray enters a sphere: along the tangents. Not below the true one.
float sphere_farthest_entry(vec3 center, float radius) {
    if (!is_perspective)
        return -center.z + 1e-6 * (abs(center.z) + radius);
    float to_center = length(center);
    float tangent_2 = max((to_center - radius) * (to_center + radius), 0.0) + 4e-7 * to_center * to_center;
    return sqrt(tangent_2) + 1e-6 * (to_center + radius);
}
