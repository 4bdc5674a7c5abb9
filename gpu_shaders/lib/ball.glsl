// The balls, as textures give them.
#include "lib/chord.glsl"

uniform sampler2D sphere_tx; // view-space centre, influence radius R
uniform sampler2D density_tx; // weight q, kernel radius (0: none)

ivec2 ball_texel(uint id) {
    return ivec2(id % uint(BALL_TEXTURE_WIDTH), id / uint(BALL_TEXTURE_WIDTH));
}

Ball ball_fetch(uint id) {
    vec4 sphere = texelFetch(sphere_tx, ball_texel(id), 0);
    return Ball(sphere.xyz, sphere.w);
}

// Those of attributes that are wanted are in color_tx, velocity_tx (world space) and index_tx (of the ball among all balls).
vec2 ball_density(uint id) {
    return texelFetch(density_tx, ball_texel(id), 0).xy;
}
