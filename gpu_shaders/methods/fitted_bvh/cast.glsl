// The ray of a pixel, and what it finds.
#include "lib/tree_camera.glsl"
#include "lib/tree_surface.glsl"

uniform vec2 clip_depths; // planar, less that of the anchor

struct Found {
    float depth;
    LeafSurface surface;
};

Found cast_pixel(vec2 pixel) {
    Ray ray = ray_from_pixel(pixel);
    Segment segment = tree_camera_segment(ray);
    Found found = Found(DEPTH_BACKGROUND, LeafSurface(vec3(0.0), 0.0, 0.0, -1, vec3(0.0), vec3(0.0)));
    TreeHit hit;
    if (tree_cast(segment, clip_depths.x * ray.stretch, clip_depths.y * ray.stretch, true, false, false, hit)) {
        found.surface = tree_surface(segment, hit);
        found.depth = min(anchor_depth + hit.t / ray.stretch, DEPTH_BACKGROUND);
    }
    return found;
}
