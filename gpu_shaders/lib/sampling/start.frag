// On which side of the surface each ray starts: 1 outside the fluid, -1 inside; and by how much, turned so that it is not above 0.
// Densities turned by this side rise through 0 where the ray meets the surface.

uniform sampler2D density_sum_tx;
uniform float threshold;

layout(location = 0) out vec2 out_side;

void main() {
    float above = texelFetch(density_sum_tx, ivec2(gl_FragCoord.xy), 0).x - threshold;
    out_side = vec2(above >= 0.0 ? -1.0 : 1.0, -abs(above));
}
