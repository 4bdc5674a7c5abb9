// The first crossing of the surface in a ball's own part of its influence sphere (Mueller, Grottel and Ertl 2007, section 3.1). The
// depth test keeps the nearest of all balls, which is the first of the ray: each crossing lies in the part of some ball, and the density
// there is that of the ball and its neighbours. A ball without neighbours is its kernel sphere.
#include "lib/conservative_depth.glsl"
#include "lib/scene_camera.glsl"
#include "methods/vicinity/depth.glsl"
#include "methods/vicinity/kernel_sphere.glsl"
#include "methods/vicinity/lists.glsl"
#include "lib/outputs.glsl"
#include "methods/vicinity/cell.glsl"
#include "lib/leaf_surface.glsl"
#if EXACT
#include "lib/leaf.glsl"
#else
#include "methods/vicinity/march.glsl"
#endif

uniform sampler2D barrier_tx;

flat in vec4 v_sphere;
flat in float v_kernel_radius;

void main() {
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    vec3 start = scene_start(ray), direction = scene_direction(ray);
    float barrier = barrier_distance(texelFetch(barrier_tx, ivec2(gl_FragCoord.xy), 0).x);
    // What follows counts from where the ray is nearest to the centre.
    float middle = dot(v_sphere.xyz - start, direction);
    Leaf leaf = Leaf(0u, v_count + 1u, start + middle * direction, direction);
    LeafBall own = leaf_ball(leaf, 0u);
    float half_length = sqrt(max(own.peak, 0.0)) / own.inverse;
    float begin = max(own.middle - half_length, clip_depths.x * ray.stretch - middle);
    float last = min(clip_depths.y * ray.stretch, barrier) - middle;
    float end = min(own.middle + half_length, last);
    float at = end;
    bool is_inside = false, is_found = false;
    if (v_count == 0u) {
        vec2 chord = kernel_sphere_chord(start, direction, v_sphere.xyz, v_kernel_radius);
        is_inside = chord.x - chord.y < clip_depths.x * ray.stretch;
        at = (is_inside ? chord.x + chord.y : chord.x - chord.y) - middle;
        // The barrier may be this very sphere, rounded another way.
        is_found = chord.y > 0.0 && at + middle >= clip_depths.x * ray.stretch && at <= last + 1e-6 * abs(chord.x);
        at = min(at, last);
    } else if (begin < end && cell_clip(leaf, own, v_sphere, abs(middle) + length(leaf.point), begin, end)) {
        bool ends_inside = barrier < NOWHERE && end >= barrier - middle;
#if EXACT
        is_inside = leaf_contains(0u, leaf.count, leaf.point + begin * direction);
        is_found = leaf_crossing(LeafStretch(leaf.point, direction, begin, end), 0u, leaf.count, is_inside, false, at);
        if (!is_found && ends_inside && !is_inside) {
            is_found = true;
            at = end;
        }
#else
        is_found = march(leaf, begin, end, v_sphere.w, ends_inside, at, is_inside);
#endif
    }
    if (!is_found)
        discard;
    // To the last digit, or the depth test would drop what lies on the barrier.
    float t = min(middle + at, barrier);
    LeafSurface surface =
        leaf_surface(0u, leaf.count, leaf.point + at * direction, direction * (is_inside ? 1.0 : -1.0));
    out_depth = min(anchor_depth + t / ray.stretch, DEPTH_BACKGROUND);
    out_normal = vec4(surface.normal, 0.0);
#if WITH_COLORS
    out_color = vec4(surface.color, 0.0);
#endif
#if WITH_VELOCITIES
    out_velocity = vec4(surface.velocity, 0.0);
#endif
#if WITH_BALLS
    out_ball = surface.ball;
#endif
    gl_FragDepth = clamp(t * depth_scale, 0.0, 1.0);
}
