// The rays of a camera as segments in the scene coordinates of a tree.
#include "lib/fitted_bvh.glsl"
#include "lib/scene_camera.glsl"

Segment tree_camera_segment(Ray ray) {
    return segment_from(scene_start(ray), scene_direction(ray));
}
