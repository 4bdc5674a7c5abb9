// Adds the ball's pull on the gradient, and its share of the attributes, at the surface; by blending.
#include "lib/sampling/surface.glsl"

#if WITH_COLORS
uniform sampler2D color_tx;
#endif
#if WITH_VELOCITIES
uniform sampler2D velocity_tx;
#endif

layout(location = 0) out vec4 out_gradient; // against it, view space; density
#if WITH_COLORS
layout(location = COLOR_SUM) out vec4 out_color; // times the density
#endif
#if WITH_VELOCITIES
layout(location = VELOCITY_SUM) out vec4 out_velocity;
#endif

void main() {
    SurfaceShare share = surface_share();
    out_gradient = vec4(share.gradient, share.density);
#if WITH_COLORS
    out_color = share.density * texelFetch(color_tx, ball_texel(v_id), 0);
#endif
#if WITH_VELOCITIES
    out_velocity = share.density * texelFetch(velocity_tx, ball_texel(v_id), 0);
#endif
}
