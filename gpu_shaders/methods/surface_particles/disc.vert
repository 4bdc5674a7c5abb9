// Two triangles around the picture of each disc. Six vertices each: drivers do badly with instances of so few.
#include "lib/scene_camera.glsl"
#include "lib/sphere_bounds.glsl"
#include "lib/triangles.glsl"
#include "methods/surface_particles/state.glsl"

uniform sampler2D bend_along_tx;
uniform sampler2D bend_across_tx;
uniform float depth_scale;
uniform vec2 clip_distances; // planar

flat out vec4 v_place;
flat out vec4 v_normal;
flat out vec4 v_along;
flat out vec4 v_across;

void main() {
    int particle = gl_VertexID / 6;
    v_place = particle_place(particle);
    v_normal = particle_normal(particle);
    v_along = texelFetch(bend_along_tx, particle_texel(particle), 0);
    v_across = texelFetch(bend_across_tx, particle_texel(particle), 0);
    float radius = v_along.w;
    vec3 center = (v_place.xyz - anchor) * world_from_view - vec3(0.0, 0.0, anchor_depth);
    float slack = 1e-5 * radius + 1e-6 * length(center);
    float nearest = -center.z - radius - slack, farthest = radius + slack - center.z;
    vec4 rectangle = sphere_rectangle(center, radius + slack);
    bool is_drawn = v_place.w > 0.0 && farthest >= clip_distances.x && nearest <= clip_distances.y;
    vec2 corner = is_drawn ? square_corner(gl_VertexID % 6) : vec2(0.0);
    vec2 position = mix(rectangle.xy, max(rectangle.zw, rectangle.xy), corner) / image_middle - 1.0;
    // Nearer than anything of the disc: fragments may be dropped early by this depth.
    float depth = clamp((nearest - anchor_depth) * depth_scale, 0.0, 1.0);
    gl_Position = vec4(position, max(2.0 * depth - 1.0 - 2e-6, -1.0), 1.0);
}
