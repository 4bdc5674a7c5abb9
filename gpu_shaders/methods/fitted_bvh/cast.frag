// Casts the ray of each pixel.
#include "methods/fitted_bvh/cast.glsl"

layout(location = 0) out float out_depth;
layout(location = 1) out vec4 out_normal;
#if WITH_COLORS
layout(location = COLOR_LOCATION) out vec4 out_color;
#endif
#if WITH_VELOCITIES
layout(location = VELOCITY_LOCATION) out vec4 out_velocity;
#endif
#if WITH_BALLS
layout(location = BALL_LOCATION) out int out_ball;
#endif



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
