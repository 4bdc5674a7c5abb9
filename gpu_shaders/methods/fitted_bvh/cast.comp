// Casts the ray of each pixel: a group of threads for 8 x 4 pixels, in squares of 4 x 4. Larger groups would hold their memory until
// the slowest ray is done.
#include "methods/fitted_bvh/cast.glsl"

layout(local_size_x = 32) in;

layout(r32f, binding = 0) writeonly uniform image2D depth_image;
layout(rgba32f, binding = 1) writeonly uniform image2D normal_image;
#if WITH_COLORS
layout(rgba32f, binding = 2) writeonly uniform image2D color_image;
#endif
#if WITH_VELOCITIES
layout(rgba32f, binding = 3) writeonly uniform image2D velocity_image;
#endif
#if WITH_BALLS
layout(r32i, binding = 4) writeonly uniform iimage2D ball_image;
#endif

uniform ivec2 image_size;

void main() {
    uint own = gl_LocalInvocationIndex;
    ivec2 inside = ivec2((own & 3u) | (own >> 2u & 4u), own >> 2u & 3u);
    ivec2 pixel = ivec2(gl_WorkGroupID.xy) * ivec2(8, 4) + inside;
    if (any(greaterThanEqual(pixel, image_size)))
        return;
    Found found = cast_pixel(vec2(pixel) + 0.5);
    imageStore(depth_image, pixel, vec4(found.depth));
    imageStore(normal_image, pixel, vec4(found.surface.normal, 0.0));
#if WITH_COLORS
    imageStore(color_image, pixel, vec4(found.surface.color, 0.0));
#endif
#if WITH_VELOCITIES
    imageStore(velocity_image, pixel, vec4(found.surface.velocity, 0.0));
#endif
#if WITH_BALLS
    imageStore(ball_image, pixel, ivec4(found.surface.ball));
#endif
}
