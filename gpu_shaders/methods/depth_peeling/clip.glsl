// The clip distances along a ray.
#include "methods/depth_peeling/state.glsl"

uniform vec2 clip_distances; // planar

float clip_start(Ray ray) {
    return clip_distances.x * ray.stretch * depth_scale;
}

float clip_end(Ray ray) {
    return clip_distances.y * ray.stretch * depth_scale;
}
