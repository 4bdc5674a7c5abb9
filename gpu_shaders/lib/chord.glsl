// Balls on rays.
#include "lib/ray.glsl"

struct Ball {
    vec3 center;
    float radius;
};

// A ball on a ray: x(t) = peak - ((t - middle) / R)^2, t the distance along the ray.
struct Chord {
    float peak;
    float middle;
    float radius;
};

// From the ray to the centre in the plane of the centre's depth; the only subtraction of large numbers.
vec2 ball_offset(Ball ball, Ray ray) {
    return ball.center.xy - ray.origin + ball.center.z * ray.slope;
}

Chord ball_chord(Ball ball, Ray ray) {
    vec2 offset = ball_offset(ball, ray);
    float along = dot(offset, ray.slope);
    // In radii: their squares may be more than floats hold.
    vec2 apart = offset / (ball.radius * ray.stretch);
    float turn = apart.x * ray.slope.y - apart.y * ray.slope.x;
    // |offset x direction|^2 / |direction|^2: nothing cancels.
    float distance_2 = dot(apart, apart) + turn * turn;
    return Chord(1.0 - distance_2, along / ray.stretch - ball.center.z * ray.stretch, ball.radius);
}

// From the ball's centre to the point at distance t along the ray, in radii.
vec3 ball_from_center(Ball ball, Ray ray, Chord chord, float t) {
    vec3 direction = vec3(ray.slope, -1.0) / ray.stretch;
    // From the centre to the middle of the chord, then along the chord.
    vec2 offset = ball_offset(ball, ray);
    vec3 to_middle = -vec3(offset, 0.0) + direction * (dot(offset, ray.slope) / ray.stretch);
    return to_middle / chord.radius + direction * ((t - chord.middle) / chord.radius);
}

float chord_half_length(Chord chord) {
    return chord.radius * sqrt(max(chord.peak, 0.0));
}

float chord_x(Chord chord, float t) {
    float from_middle = (t - chord.middle) / chord.radius;
    return chord.peak - from_middle * from_middle;
}
