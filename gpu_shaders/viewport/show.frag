// Brings shaded samples to the screen, with their depth, so that meshes hide them and are hidden by them.

const float BACKGROUND = 1e10;

vec4 color_at(vec2 position, ivec2 last) {
    ivec2 low = ivec2(floor(position - 0.5));
    vec2 share = position - 0.5 - vec2(low);
    vec4 values[4];
    for (int corner = 0; corner < 4; ++corner)
        values[corner] = texelFetch(shaded_tx, clamp(low + ivec2(corner & 1, corner >> 1), ivec2(0), last), 0);
    return mix(mix(values[0], values[1], share.x), mix(values[2], values[3], share.x), share.y);
}

// Where samples of a pixel meet fluid and its centre does not, that of the nearest neighbour.
float depth_at(ivec2 pixel, ivec2 last) {
    float depth = texelFetch(depth_tx, pixel, 0).x;
    if (depth < BACKGROUND)
        return depth;
    for (int neighbour = 0; neighbour < 9; ++neighbour) {
        ivec2 beside = clamp(pixel + ivec2(neighbour % 3, neighbour / 3) - 1, ivec2(0), last);
        depth = min(depth, texelFetch(depth_tx, beside, 0).x);
    }
    return depth;
}

void main() {
    ivec2 last = textureSize(depth_tx, 0) - 1;
    vec2 position = place * vec2(last + 1);
    vec4 color = color_at(position, last) * params.samples.x;
    float depth = depth_at(clamp(ivec2(position), ivec2(0), last), last);
    if (depth >= BACKGROUND || color.a < 1.0 / 512.0)
        discard;
    out_color = color;
    vec4 row = params.projection;
    gl_FragDepth = 0.5 + 0.5 * (row.y - row.x * depth) / (row.w - row.z * depth);
}
