// Two triangles around the picture of each glyph. Six vertices each: drivers do badly with instances of so few.
#include "lib/triangles.glsl"
#include "methods/glyphs/glyph_texture.glsl"

uniform float depth_scale; // of planar depths, to less than 1

flat out int v_number;
flat out vec4 v_glyph[GLYPH_TEXELS];

const float UNBOUNDED = 1e30;
// Rounding may not lose a pixel centre.
const float RECTANGLE_MARGIN = 0.1;

// The parts of all semi-axes along a direction of view space.
#if ELLIPSOIDS
vec3 glyph_reaches(Glyph glyph, int axis) {
    return glyph.lengths * vec3(glyph.axes[0][axis], glyph.axes[1][axis], glyph.axes[2][axis]);
}
#endif

float glyph_reach_2(Glyph glyph, int one, int other) {
#if ELLIPSOIDS
    return dot(glyph_reaches(glyph, one), glyph_reaches(glyph, other));
#else
    return one == other ? glyph.radius * glyph.radius : 0.0;
#endif
}

// Where a glyph begins and ends along an axis, in units of the camera's window. In perspective between the tangent planes through
// the eye, whose places x are the roots of (n . centre)^2 = |axes n|^2 with n = (1, x); what reaches behind the eye may be anywhere.
vec2 glyph_extent(Glyph glyph, int axis, float depth_reach) {
    float across = glyph.center[axis], depth = -glyph.center.z;
    float own = glyph_reach_2(glyph, axis, axis);
    if (!is_perspective)
        return across + sqrt(own) * vec2(-1.0, 1.0);
    if (depth <= 1.001 * depth_reach)
        return vec2(-UNBOUNDED, UNBOUNDED);
    // The view looks along -z.
    float mixed = -glyph_reach_2(glyph, axis, 2), deep = depth_reach * depth_reach;
    float clearance = (depth - depth_reach) * (depth + depth_reach);
    float square = depth * depth * own - 2.0 * across * depth * mixed + across * across * deep;
    float root = sqrt(max(square - (own * deep - mixed * mixed), 0.0));
    return (across * depth - mixed + root * vec2(-1.0, 1.0)) / clearance;
}

// The pixels around a glyph: low corner, high corner; within the image.
vec4 glyph_rectangle(Glyph glyph, float depth_reach) {
    vec2 extent_x = glyph_extent(glyph, 0, depth_reach);
    vec2 extent_y = glyph_extent(glyph, 1, depth_reach);
    vec4 window = vec4(extent_x.x, extent_y.x, extent_x.y, extent_y.y);
    vec4 pixels = (window - window_middle.xyxy) / pixel_size.xyxy + image_middle.xyxy;
    pixels += RECTANGLE_MARGIN * vec4(-1.0, -1.0, 1.0, 1.0);
    return clamp(pixels, vec4(0.0), 2.0 * image_middle.xyxy);
}

void main() {
    v_number = gl_VertexID / 6;
    vec4 texels[GLYPH_TEXELS];
    glyph_fetch(v_number, texels);
    v_glyph = texels;
    Glyph glyph = glyph_unpack(texels);
    float depth_reach = sqrt(glyph_reach_2(glyph, 2, 2));
    vec4 rectangle = glyph_rectangle(glyph, depth_reach);
    vec2 position = mix(rectangle.xy, max(rectangle.zw, rectangle.xy), square_corner(gl_VertexID % 6)) / image_middle - 1.0;
    // A little nearer than any point of it: fragments may be dropped early by this depth.
    float depth = -glyph.center.z - depth_reach - 1e-6 * (abs(glyph.center.z) + depth_reach);
    gl_Position = vec4(position, 2.0 * clamp(depth * depth_scale, 0.0, 1.0) - 1.0, 1.0);
    gl_Position.z = max(gl_Position.z - 1e-6, -1.0);
}
