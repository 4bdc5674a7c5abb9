// The way from scene-linear colours to the display, by Blender's view transform as a table of code values.
// The table's axes are logarithms; view_transform.py makes it.
const float TABLE_LOW = -6.0;
const float TABLE_HIGH = 14.0 / 3.0;
const float TABLE_OFFSET = 1.0 / 63.0;

vec3 decoded(vec3 code) {
    vec3 low = code / 12.92;
    vec3 high = pow((max(code, vec3(0.0)) + 0.055) / 1.055, vec3(2.4));
    return mix(high, low, vec3(lessThanEqual(code, vec3(0.04045))));
}

vec3 encoded(vec3 light) {
    vec3 low = light * 12.92;
    vec3 high = 1.055 * pow(max(light, vec3(0.0)), vec3(1.0 / 2.4)) - 0.055;
    return mix(high, low, vec3(lessThanEqual(light, vec3(0.0031308))));
}

// Cell (r, g, b) of the table lies at column r + g * size of row b.
vec3 table_cell(ivec3 cell, int size) {
    return texelFetch(table_tx, ivec2(cell.r + cell.g * size, cell.b), 0).rgb;
}

vec3 in_table(vec3 light, int size) {
    vec3 above_zero = (max(light, vec3(0.0)) + TABLE_OFFSET) / (1.0 + TABLE_OFFSET);
    vec3 place = (log2(above_zero) - TABLE_LOW) / (TABLE_HIGH - TABLE_LOW);
    vec3 position = clamp(place, 0.0, 1.0) * float(size - 1);
    ivec3 low = min(ivec3(position), ivec3(size - 2));
    vec3 share = position - vec3(low);
    vec3 code = vec3(0.0);
    for (int corner = 0; corner < 8; ++corner) {
        ivec3 side = ivec3(corner & 1, (corner >> 1) & 1, corner >> 2);
        vec3 weight = mix(1.0 - share, share, vec3(side));
        code += weight.r * weight.g * weight.b * table_cell(low + side, size);
    }
    return code;
}

// Linear light of an sRGB display.
vec3 displayed(vec3 light) {
    light *= params.display.x;
    int size = int(params.display.z + 0.5);
    if (size == 0 && params.display.y == 1.0)
        return clamp(light, 0.0, 1.0);
    vec3 code = size > 0 ? in_table(light, size) : encoded(clamp(light, 0.0, 1.0));
    return decoded(pow(clamp(code, 0.0, 1.0), vec3(params.display.y)));
}
