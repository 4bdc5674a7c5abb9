// An inverted spatial hash of the balls (van Kooten, van den Bergen and Telea 2007, sections 7.2.4 and 7.2.5): a ball is in every cell
// that it reaches, so that one cell holds all balls of a point. Each octave of radii has cells of its own size; entries know their
// cells, so that no ball is met twice where two of its cells share a bucket. The same as native/core/src/surface_particles/hash.rs.

// Of each level the side of a cell as bits of a float, the number of buckets, a power of two, the first bucket, and the first entry.
uniform usampler2D level_tx;
uniform usampler2D start_tx; // of each bucket the first entry, counted in its level; then the end of the level
uniform usampler2D entry_tx; // ball, tag of the cell
uniform sampler2D ball_tx;   // centre from the anchor, influence radius

const ivec3 HASH_PRIMES = ivec3(11113, 12979, 13513);
const float HASH_FARTHEST_CELL = 1073741824.0;

// What a point finds on a level: the entries of its bucket, of which those with its tag are of its own cell.
struct Bucket {
    uint begin;
    uint count;
    uint tag;
};

ivec2 hash_texel(uint row) {
    return ivec2(row % uint(ROW_TEXTURE_WIDTH), row / uint(ROW_TEXTURE_WIDTH));
}

int hash_levels() {
    return min(textureSize(level_tx, 0).x, MOST_LEVELS);
}

// Differs among cells which are less than 1024 apart.
uint hash_tag(ivec3 cell) {
    uvec3 low = uvec3(cell) & 1023u;
    return low.x | low.y << 10u | low.z << 20u;
}

// The bucket of a cell (equation 4).
uint hash_bucket(ivec3 cell, uint buckets) {
    ivec3 scaled = HASH_PRIMES * cell;
    int sum = scaled.x + scaled.y + scaled.z;
    return uint(sum < 0 ? -sum : sum) & (buckets - 1u);
}

Bucket hash_find(int number, vec3 point) {
    uvec4 level = texelFetch(level_tx, ivec2(number, 0), 0);
    vec3 place = floor(point / uintBitsToFloat(level.x));
    ivec3 cell = ivec3(clamp(place, -HASH_FARTHEST_CELL, HASH_FARTHEST_CELL));
    uint bucket = level.z + hash_bucket(cell, level.y);
    uint begin = texelFetch(start_tx, hash_texel(bucket), 0).x, end = texelFetch(start_tx, hash_texel(bucket + 1u), 0).x;
    return Bucket(level.w + begin, min(end - begin, MOST_ENTRIES), hash_tag(cell));
}

// The ball of an entry, if it is one of the bucket's cell; else -1.
int hash_ball(Bucket bucket, uint number) {
    uvec2 about = texelFetch(entry_tx, hash_texel(bucket.begin + number), 0).xy;
    return about.y == bucket.tag ? int(about.x) : -1;
}

vec4 hash_sphere(int ball) {
    return texelFetch(ball_tx, hash_texel(uint(ball)), 0);
}
