// Distances along rays, from the plane of the anchor on, as depths. Times a power of two they are below 1/2, and lose no digit.

uniform float depth_scale;
uniform vec2 clip_distances; // planar, from the eye
uniform vec2 clip_depths;    // planar, from the anchor

const float NO_BARRIER = 1.0; // the greatest depth
const float NOWHERE = 3e38;

float barrier_distance(float depth) {
    return depth < NO_BARRIER ? depth / depth_scale : NOWHERE;
}
