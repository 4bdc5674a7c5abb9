// Traces the light of each pixel that shows a surface.
#include "lib/trace.glsl"

uniform sampler2D depth_tx;
uniform sampler2D normal_tx;
uniform ivec2 image_size;

layout(location = 0) out vec4 out_color;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float depth = texelFetch(depth_tx, pixel, 0).x;
    out_color = vec4(0.0);
    if (depth < DEPTH_BACKGROUND)
        out_color = trace_pixel(gl_FragCoord.xy, uint(pixel.y * image_size.x + pixel.x), depth, texelFetch(normal_tx, pixel, 0).xyz);
}
