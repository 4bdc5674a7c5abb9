// The surface as the renderer wants it: where the discs of a pixel are on average; with `is_exact` where the ray meets the surface
// near there. Colours, velocities and balls are those of the fluid at the place.
#include "lib/outputs.glsl"
#include "methods/surface_particles/fluid.glsl"
#include "lib/scene_camera.glsl"
#include "methods/surface_particles/front.glsl"
#include "methods/surface_particles/ray_start.glsl"

uniform sampler2D normal_sum_tx;
uniform sampler2D way_sum_tx;
uniform bool is_exact;
uniform vec2 clip_depths; // planar, from the anchor
#if WITH_COLORS
uniform sampler2D color_tx;
#endif

// How often a point is moved along its ray, and how far at most, in influence radii.
const int FINISH_STEPS = 12;
const float FINISH_LONGEST_STEP = 0.1;

// How far beyond the front that was tried the next round begins, in influence radii.
const float FINISH_BEYOND = 0.02;

layout(location = BEYOND_LOCATION) out float out_beyond;

struct Place {
    bool is_there;
    float t;
    vec3 normal;
    float scale; // the greatest mean influence radius on the way
};

// Where a ray meets the surface near a distance.
Place place_on(vec3 start, vec3 direction, float t, float side) {
    float scale = 0.0;
    for (int i = 0; i < FINISH_STEPS; i++) {
        Sample found = fluid_sample(start + t * direction);
        float slope = length(found.gradient), rise = side * dot(found.gradient, direction);
        scale = max(scale, found.scale);
        float missing = side * (isovalue - found.density);
        if (!(slope > 0.0))
            break;
        if (abs(missing) <= 1e-5 * slope * found.scale && rise > 0.0)
            return Place(true, t, -found.gradient / slope, scale);
        float longest = FINISH_LONGEST_STEP * found.scale;
        t += clamp(missing / max(rise, 0.01 * slope), -longest, longest);
    }
    return Place(false, t, vec3(0.0), scale);
}

// Weighted by the share of each ball in the density.
void put_attributes(vec3 point) {
    float density = 0.0, greatest = 0.0;
    vec3 color = vec3(0.0), velocity = vec3(0.0);
    int dominant = -1;
    int count = hash_levels();
    for (int level = 0; level < count; level++) {
        Bucket bucket = hash_find(level, point);
        for (uint i = 0u; i < bucket.count; i++) {
            int ball = hash_ball(bucket, i);
            if (ball < 0)
                continue;
            vec4 sphere = hash_sphere(ball), motion = texelFetch(motion_tx, hash_texel(uint(ball)), 0);
            vec3 offset = (point - sphere.xyz) / sphere.w;
            float share = motion.w * kernel_value(1.0 - dot(offset, offset));
            density += share;
            velocity += share * motion.xyz;
#if WITH_COLORS
            color += share * texelFetch(color_tx, hash_texel(uint(ball)), 0).rgb;
#endif
            // Of equals the first, whatever the order of the levels.
            if (share > greatest || (share == greatest && share > 0.0 && ball < dominant)) {
                greatest = share;
                dominant = ball;
            }
        }
    }
    float scale = density != 0.0 ? 1.0 / density : 0.0;
#if WITH_COLORS
    out_color = vec4(scale * color, 0.0);
#endif
#if WITH_VELOCITIES
    out_velocity = vec4(scale * velocity, 0.0);
#endif
#if WITH_BALLS
    out_ball = dominant;
#endif
}

// Where a pixel's discs are on average.
Place place_between(ivec2 pixel, float front) {
    vec4 sum = texelFetch(normal_sum_tx, pixel, 0);
    return Place(sum.w > 0.0, front + texelFetch(way_sum_tx, pixel, 0).x / max(sum.w, 1e-30), normalize(sum.xyz), 0.0);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    // What an earlier round has found stays.
    if (front_is_empty(pixel))
        discard;
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    vec3 start = scene_start(ray), direction = scene_direction(ray);
    float front = front_distance(pixel);
    // From the nearest disc on no surface is passed over.
    Place place = is_exact ? place_on(start, direction, front, starts_inside(pixel) ? -1.0 : 1.0) : place_between(pixel, front);
    float depth = place.t / ray.stretch;
    put_nothing();
    out_beyond = front + FINISH_BEYOND * place.scale;
    if (place.is_there && depth >= clip_depths.x && depth <= clip_depths.y) {
        out_beyond = FRONT_DONE;
        out_depth = min(anchor_depth + depth, DEPTH_BACKGROUND);
        out_normal = vec4(place.normal, 0.0);
#if WITH_COLORS || WITH_VELOCITIES || WITH_BALLS
        put_attributes(start + place.t * direction);
#endif
    }
}
