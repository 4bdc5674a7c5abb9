// The rays of a camera in the scene coordinates of a tree. They begin at a plane near the tree, so that what is large has been
// subtracted before, in double precision.
#include "lib/fitted_bvh.glsl"

uniform mat3 world_from_view;
uniform vec3 anchor;        // on the camera's axis, not farther than the tree; scene coordinates
uniform float anchor_depth; // planar

// Distances along it count from the anchor's plane.
Segment tree_camera_segment(Ray ray) {
    vec3 across = is_perspective ? vec3(anchor_depth * ray.slope, 0.0) : vec3(ray.origin, 0.0);
    return segment_from(anchor + world_from_view * across, world_from_view * (vec3(ray.slope, -1.0) / ray.stretch));
}
