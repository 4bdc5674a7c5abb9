// The ball with the greatest share of the density at the surface, by the depth test: of equal ones the first.
#include "lib/sampling/surface.glsl"

uniform isampler2D index_tx;
uniform float threshold;

layout(location = 0) out uint out_ball; // its index among all balls, plus 1

void main() {
    SurfaceShare share = surface_share();
    out_ball = uint(texelFetch(index_tx, ball_texel(v_id), 0).x + 1);
    gl_FragDepth = share.density / (share.density + threshold);
}
