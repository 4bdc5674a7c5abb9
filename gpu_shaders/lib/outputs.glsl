// What a fragment says of the surface; in the order of the textures.

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

void put_nothing() {
    out_depth = DEPTH_BACKGROUND;
    out_normal = vec4(0.0);
#if WITH_COLORS
    out_color = vec4(0.0);
#endif
#if WITH_VELOCITIES
    out_velocity = vec4(0.0);
#endif
#if WITH_BALLS
    out_ball = -1;
#endif
}
