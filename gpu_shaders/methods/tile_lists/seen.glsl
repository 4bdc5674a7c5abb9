// The balls that may be seen, in no certain order.

struct Seen {
    vec4 sphere; // view space, influence radius
    uint id;
    float front; // before this distance no ray meets it
    uint first;  // tile, 16 bits each way
    uint last;   // tile, 14 bits each way, and the level
};

uint pack_first(ivec2 tile) {
    return uint(tile.x) | uint(tile.y) << 16u;
}

ivec2 unpack_first(uint bits) {
    return ivec2(bits & 0xffffu, bits >> 16u);
}

uint pack_last(ivec2 tile, int level) {
    return uint(tile.x) | uint(tile.y) << 14u | uint(level) << 28u;
}

ivec2 unpack_last(uint bits) {
    return ivec2(bits & 0x3fffu, (bits >> 14u) & 0x3fffu);
}

int unpack_level(uint bits) {
    return int(bits >> 28u);
}

// Counts of a frame, and how many groups of threads the steps need that follow from them.
layout(std430, binding = 7) buffer Counts {
    uint seen_count;    // also those that found no room
    uint entry_count;   // the same
    uint crowded_count; // rays in more balls at once than they can list
    uint longest_list;
    uint fill_groups[3];
    uint long_count; // lists that groups of threads sort
    uint long_groups[3];
    uint has_overflown; // the number of entries
    uint longest_groups[3];
    uint longest_count; // lists that large groups of threads sort
} counts;

uniform uint seen_capacity;
uniform uint entry_capacity;

// Whether there is room for everything; else there are no lists, as they would have holes.
bool lists_fit() {
    return counts.seen_count <= seen_capacity && counts.entry_count <= entry_capacity && counts.has_overflown == 0u;
}
