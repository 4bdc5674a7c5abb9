// The rays of a camera in scene coordinates: world space less an origin. They begin at a plane near the balls, so that what is large
// has been subtracted before, in double precision.
#include "lib/ray.glsl"

uniform mat3 world_from_view;
uniform vec3 anchor;        // on the camera's axis, not farther than the balls; scene coordinates
uniform float anchor_depth; // planar

// Distances along it count from the anchor's plane.
vec3 scene_start(Ray ray) {
    vec3 across = is_perspective ? vec3(anchor_depth * ray.slope, 0.0) : vec3(ray.origin, 0.0);
    return anchor + world_from_view * across;
}

vec3 scene_direction(Ray ray) {
    return world_from_view * (vec3(ray.slope, -1.0) / ray.stretch);
}
