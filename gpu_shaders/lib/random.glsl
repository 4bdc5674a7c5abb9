// Points that fill a square evenly, and directions made of them: Sobol's sequence, scrambled as Owen does it, anew for each pixel and
// each use (Burley 2020). The same numbers as those of native/core/src/tracing/random.rs, rounded.

const float TAU = 6.28318530718;

// Mixes the bits of a number, each of which changes half of the others (Wellons 2018).
uint random_mixed(uint number) {
    number = (number ^ number >> 16u) * 0x7feb352du;
    number = (number ^ number >> 15u) * 0x846ca68bu;
    return number ^ number >> 16u;
}

// The seed of a further use.
uint random_branch(uint seed, uint use) {
    return random_mixed(seed ^ use * 0x9e3779b9u);
}

uint random_reversed(uint bits) {
    bits = bits >> 1u & 0x55555555u | (bits & 0x55555555u) << 1u;
    bits = bits >> 2u & 0x33333333u | (bits & 0x33333333u) << 2u;
    bits = bits >> 4u & 0x0f0f0f0fu | (bits & 0x0f0f0f0fu) << 4u;
    bits = bits >> 8u & 0x00ff00ffu | (bits & 0x00ff00ffu) << 8u;
    return bits >> 16u | bits << 16u;
}

// Permutes numbers such that each bit depends on itself and on lower ones (Laine and Karras 2011, constants by Burley 2020).
uint random_scrambled(uint number, uint seed) {
    number += seed;
    number ^= number * 0x6c50b47cu;
    number ^= number * 0xb82f1e52u;
    number ^= number * 0xc7afe638u;
    number ^= number * 0x8d22f6e6u;
    return number;
}

// The second coordinate of Sobol's sequence, as bits of a fraction.
uint random_sobol(uint index) {
    uint direction = 1u << 31u, bits = 0u;
    for (uint i = 0u; i < 32u; i++) {
        bits ^= (index >> i & 1u) * direction;
        direction ^= direction >> 1u;
    }
    return bits;
}

// Scrambles the digits of a binary fraction, the last of which comes first; less than 1.
float random_fraction(uint reversed, uint seed) {
    return float(random_reversed(random_scrambled(reversed, seed)) >> 8u) / 16777216.0;
}

vec2 random_square(uint seed, uint index) {
    // Indices of an aligned block stay one.
    index = random_reversed(random_scrambled(random_reversed(index), seed));
    float y = random_fraction(random_reversed(random_sobol(index)), random_branch(seed, 2u));
    return vec2(random_fraction(index, random_branch(seed, 1u)), y);
}

// A direction that follows from a number, any as likely as any other.
vec3 random_direction(uint number) {
    const float MOST = 4294967295.0;
    float z = 2.0 * (float(random_mixed(number)) / MOST) - 1.0;
    float turn = TAU * (float(random_mixed(number ^ 0x55aa55aau)) / MOST);
    return vec3(sqrt(max(1.0 - z * z, 0.0)) * vec2(cos(turn), sin(turn)), z);
}

// A vector given along two unit vectors at right angles to a unit normal, and along that; without a seam but where it points down
// (Duff et al. 2017).
vec3 random_along(vec3 normal, vec3 local) {
    float side = normal.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (side + normal.z), b = normal.x * normal.y * a;
    vec3 right = vec3(1.0 + side * normal.x * normal.x * a, side * b, -side * normal.x);
    vec3 up = vec3(b, side + normal.y * normal.y * a, -normal.y);
    return local.x * right + local.y * up + local.z * normal;
}

vec3 random_into(vec3 normal, vec3 direction) {
    float side = normal.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (side + normal.z), b = normal.x * normal.y * a;
    vec3 right = vec3(1.0 + side * normal.x * normal.x * a, side * b, -side * normal.x);
    vec3 up = vec3(b, side + normal.y * normal.y * a, -normal.y);
    return vec3(dot(direction, right), dot(direction, up), dot(direction, normal));
}

// A direction about z, by the cosine of the angle to it.
vec3 random_by_cosine(vec2 point) {
    float radius = sqrt(point.x);
    return vec3(radius * cos(TAU * point.y), radius * sin(TAU * point.y), sqrt(1.0 - point.x));
}

// A direction about z, evenly over a cone of which 1 - cosine is given.
vec3 random_in_cone(vec2 point, float one_less_cosine) {
    float low = point.x * one_less_cosine;
    float radius = sqrt(max(low * (2.0 - low), 0.0));
    return vec3(radius * cos(TAU * point.y), radius * sin(TAU * point.y), 1.0 - low);
}

// The normal of a facet of Trowbridge and Reitz's distribution, as an eye in a direction about z sees them (Dupuy and Benyoub 2023).
vec3 random_facet(vec3 to_eye, float alpha, vec2 point) {
    vec3 eye = normalize(vec3(alpha * to_eye.xy, to_eye.z));
    float height = (1.0 - point.y) * (1.0 + eye.z) - eye.z;
    float radius = sqrt(max(1.0 - height * height, 0.0));
    vec2 across = radius * vec2(cos(TAU * point.x), sin(TAU * point.x)) + eye.xy;
    return normalize(vec3(alpha * across, max(height + eye.z, 1e-9)));
}
