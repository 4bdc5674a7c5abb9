// The range of distances that a larger cell asks for, from those of the smaller ones in it.

uniform sampler2D smaller_tx;
uniform int smaller_across; // smaller cells along a larger one's side

layout(location = 0) out vec2 out_range;

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * smaller_across;
    ivec2 size = textureSize(smaller_tx, 0);
    ivec2 end = min(corner + smaller_across, size);
    vec2 range = vec2(4.0, -4.0);
    for (int y = corner.y; y < end.y; y++) {
        for (int x = corner.x; x < end.x; x++) {
            vec2 other = texelFetch(smaller_tx, ivec2(x, y), 0).xy;
            range = vec2(min(range.x, other.x), max(range.y, other.y));
        }
    }
    out_range = range;
}
