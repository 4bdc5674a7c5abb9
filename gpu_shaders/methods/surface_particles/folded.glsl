// The image of the search for neighbours (section 7.3.3): an orthogonal projection that is folded, so that small parts of the fluid
// which lie far apart keep its resolution. What falls together is told apart by its place in space.

uniform mat2x3 image_axes; // columns: unit, at right angles to each other
uniform float pixel_width; // Blender units; of the level
uniform int image_side;    // pixels

// The pixel of a place before folding.
ivec2 folded_pixel(vec3 position) {
    return ivec2(floor(position * image_axes / pixel_width));
}

ivec2 folded(ivec2 pixel) {
    ivec2 rest = pixel - pixel / image_side * image_side;
    return rest + image_side * ivec2(lessThan(rest, ivec2(0)));
}
