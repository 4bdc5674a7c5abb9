// Traces the light of each pixel that shows a surface: a group of threads for 8 x 4 pixels, in squares of 4 x 4.
#include "lib/trace.glsl"

layout(local_size_x = 32) in;

layout(r32f, binding = 0) readonly uniform image2D depth_image;
layout(rgba32f, binding = 1) readonly uniform image2D normal_image;
layout(rgba32f, binding = 2) writeonly uniform image2D color_image;

uniform ivec2 image_size;

void main() {
    uint own = gl_LocalInvocationIndex;
    ivec2 inside = ivec2((own & 3u) | (own >> 2u & 4u), own >> 2u & 3u);
    ivec2 pixel = ivec2(gl_WorkGroupID.xy) * ivec2(8, 4) + inside;
    if (any(greaterThanEqual(pixel, image_size)))
        return;
    float depth = imageLoad(depth_image, pixel).x;
    vec4 color = vec4(0.0);
    if (depth < DEPTH_BACKGROUND)
        color = trace_pixel(vec2(pixel) + 0.5, uint(pixel.y * image_size.x + pixel.x), depth, imageLoad(normal_image, pixel).xyz);
    imageStore(color_image, pixel, color);
}
