// Nothing is found yet, and a ray ends where a kernel sphere bars it: there it is inside the fluid, so the surface is not behind. That
// does not hold where a ball of negative weight carves, nor for a ray that starts inside.
#include "lib/outputs.glsl"
#include "methods/vicinity/depth.glsl"

layout(location = BARRIER_LOCATION) out float out_barrier;

uniform sampler2D kernel_depth_tx;
#if WITH_STARTS
uniform sampler2D start_tx;
uniform float isovalue;
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float barrier = texelFetch(kernel_depth_tx, pixel, 0).x;
#if WITH_STARTS
    vec2 start = texelFetch(start_tx, pixel, 0).xy;
    if (start.x >= isovalue || start.y > 0.0)
        barrier = NO_BARRIER;
#endif
    put_nothing();
    out_barrier = barrier;
    gl_FragDepth = barrier;
}
