// Casts the ray of each pixel.
#include "lib/outputs.glsl"
#include "methods/fitted_bvh/cast.glsl"



void main() {
    Found found = cast_pixel(gl_FragCoord.xy);
    out_depth = found.depth;
    out_normal = vec4(found.surface.normal, 0.0);
#if WITH_COLORS
    out_color = vec4(found.surface.color, 0.0);
#endif
#if WITH_VELOCITIES
    out_velocity = vec4(found.surface.velocity, 0.0);
#endif
#if WITH_BALLS
    out_ball = found.surface.ball;
#endif
}
