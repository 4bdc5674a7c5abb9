// The ray of a pixel in view space, for perspective and orthographic cameras alike:
//   p(z) = (origin, 0) + z (slope, -1),  z: planar depth.
// In perspective the origin is 0, in orthographic views the slope is 0.

uniform vec2 window_middle; // of the image rectangle: on the plane z = -1, or in Blender units
uniform vec2 pixel_size;    // in the same units
uniform vec2 image_middle;  // in pixels
uniform bool is_perspective;

struct Ray {
    vec2 origin;
    vec2 slope;
    float stretch; // length of (slope, -1): distance for each unit of planar depth
};

Ray ray_from_pixel(vec2 pixel) {
    // From the middle outwards: small numbers keep their digits.
    vec2 window = window_middle + (pixel - image_middle) * pixel_size;
    vec2 slope = is_perspective ? window : vec2(0.0);
    return Ray(is_perspective ? vec2(0.0) : window, slope, sqrt(1.0 + dot(slope, slope)));
}
