// Ranges of scaled distances: least, greatest.

const vec2 EMPTY_RANGE = vec2(4.0, -4.0);

bool range_is_empty(vec2 range) {
    return range.x > range.y;
}

vec2 range_join(vec2 one, vec2 other) {
    return vec2(min(one.x, other.x), max(one.y, other.y));
}
