// Surface particles, one texel each.

uniform sampler2D place_tx;  // from the anchor; then the mean influence radius of the balls there, 0 for a particle that has lost the surface
uniform sampler2D normal_tx; // unit, out of the fluid; then how often it left a dense place in this frame
uniform int particle_count;

ivec2 particle_texel(int particle) {
    return ivec2(particle % ROW_TEXTURE_WIDTH, particle / ROW_TEXTURE_WIDTH);
}

vec4 particle_place(int particle) {
    return texelFetch(place_tx, particle_texel(particle), 0);
}

vec4 particle_normal(int particle) {
    return texelFetch(normal_tx, particle_texel(particle), 0);
}

// The particle of a fragment, where each has one.
int particle_of_fragment(vec2 fragment) {
    return int(fragment.x) + int(fragment.y) * ROW_TEXTURE_WIDTH;
}
