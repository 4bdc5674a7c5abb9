// Where a ray meets the kernel sphere of a ball. Every pass finds it by the same operations.

// The middle between both ends, and half of what lies between them: 0 where the ray misses the sphere.
vec2 kernel_sphere_chord(vec3 start, vec3 direction, vec3 center, float radius) {
    vec3 to_center = center - start;
    float middle = dot(to_center, direction);
    vec3 apart = (to_center - middle * direction) / radius;
    return vec2(middle, radius * sqrt(max(1.0 - dot(apart, apart), 0.0)));
}
