// Two triangles around each sphere: the influence sphere of a ball, with KERNEL_SPHERES its kernel sphere. Six vertices each: drivers
// do badly with instances of so few.
#include "lib/scene_camera.glsl"
#include "lib/sphere_bounds.glsl"
#include "lib/triangles.glsl"
#include "methods/vicinity/depth.glsl"

uniform samplerBuffer balls_tx;         // centre in scene coordinates, influence radius R; in the order of space
uniform samplerBuffer kernel_radii_tx;  // 0: none
uniform usamplerBuffer starts_tx;       // where the list of each ball begins, and the end
#if WITH_WEIGHTS
uniform samplerBuffer weights_tx;
#else
uniform float weight_of_all;
#endif

flat out uint v_place;
flat out uint v_first;   // of the list
flat out uint v_count;
flat out vec4 v_sphere;
flat out float v_weight;
flat out float v_kernel_radius;

// Whether the pass is about a ball at all whose sphere lies between these planar depths.
bool is_drawn(float nearest, float farthest, uint count, float weight, float kernel_radius) {
    bool is_seen = farthest >= clip_distances.x && nearest <= clip_distances.y;
#if KERNEL_SPHERES
    return is_seen && kernel_radius > 0.0;
#elif STARTS_ONLY
    return is_seen && (weight < 0.0 || nearest <= clip_distances.x);
#else
    // A ball that is alone has no other surface.
    return is_seen && (count > 0u || kernel_radius > 0.0);
#endif
}

void main() {
    int place = gl_VertexID / 6;
    v_place = uint(place);
    v_first = texelFetch(starts_tx, place).x;
    v_count = texelFetch(starts_tx, place + 1).x - v_first;
    v_sphere = texelFetch(balls_tx, place);
#if WITH_WEIGHTS
    v_weight = texelFetch(weights_tx, place).x;
#else
    v_weight = weight_of_all;
#endif
    v_kernel_radius = texelFetch(kernel_radii_tx, place).x;
#if KERNEL_SPHERES
    float radius = v_kernel_radius;
#elif STARTS_ONLY
    float radius = v_sphere.w;
#else
    float radius = v_count > 0u ? v_sphere.w : v_kernel_radius;
#endif
    vec3 center = (v_sphere.xyz - anchor) * world_from_view - vec3(0.0, 0.0, anchor_depth);
    float slack = 1e-5 * radius + 1e-6 * length(center);
    float nearest = -center.z - radius - slack;
    vec4 rectangle = sphere_rectangle(center, radius + slack);
    // Where nothing is to be drawn all corners fall together.
    vec2 corner = is_drawn(nearest, radius + slack - center.z, v_count, v_weight, v_kernel_radius) ? square_corner(gl_VertexID % 6) : vec2(0.0);
    vec2 position = mix(rectangle.xy, max(rectangle.zw, rectangle.xy), corner) / image_middle - 1.0;
    // Nearer than anything of the sphere: fragments may be dropped early by this depth.
    float depth = clamp((nearest - anchor_depth) * depth_scale, 0.0, 1.0);
    gl_Position = vec4(position, max(2.0 * depth - 1.0 - 2e-6, -1.0), 1.0);
}
