// The lists of all tiles, one after the other: for each ball where it begins, as a number with the order of the distance, and
// its place among the seen balls.

layout(std430, binding = 11) ENTRIES_ACCESS buffer Entries {
    uvec2 entries[];
};

uint distance_key(float distance) {
    uint bits = floatBitsToUint(distance);
    return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}

float key_distance(uint key) {
    return uintBitsToFloat((key & 0x80000000u) != 0u ? key & 0x7fffffffu : ~key);
}
