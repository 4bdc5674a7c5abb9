// How far the nearest disc of a pixel is along its ray, from the anchor's plane. Where the ray met no surface near the discs of a round
// the next one takes those beyond.

uniform sampler2D front_tx;  // distances times depth_scale, a power of two: no digit is lost
uniform sampler2D beyond_tx; // distances; FRONT_DONE where nothing more is to be found
uniform float depth_scale;

const float FRONT_DONE = 3e38;

float front_distance(ivec2 pixel) {
    return texelFetch(front_tx, pixel, 0).x / depth_scale;
}

// Whether a round has found no disc for a pixel, or none was looked for.
bool front_is_empty(ivec2 pixel) {
    return texelFetch(front_tx, pixel, 0).x >= 1.0;
}

// Whether a pixel still looks for a disc, and one at this distance lies beyond what was tried.
bool front_asks(ivec2 pixel, float t) {
    return t > texelFetch(beyond_tx, pixel, 0).x;
}
