// How far the nearest disc of a pixel is along its ray, from the anchor's plane.

uniform sampler2D front_tx; // distances times depth_scale, a power of two: no digit is lost
uniform float depth_scale;

float front_distance(ivec2 pixel) {
    return texelFetch(front_tx, pixel, 0).x / depth_scale;
}
