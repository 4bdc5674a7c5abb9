// How far the nearest disc of each pixel is (section 7.6, the depth pass).
#include "lib/conservative_depth.glsl"
#include "methods/surface_particles/disc.glsl"
#include "methods/surface_particles/front.glsl"
#include "methods/surface_particles/ray_start.glsl"

flat in vec4 v_place;
flat in vec4 v_normal;
flat in vec4 v_along;
flat in vec4 v_across;

void main() {
    Disc disc = disc_unpack(v_place, v_normal, v_along, v_across);
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Meeting meeting = disc_meeting(disc, ray_from_pixel(gl_FragCoord.xy), starts_inside(pixel));
    if (!meeting.is_met || !front_asks(pixel, meeting.t))
        discard;
    gl_FragDepth = clamp(meeting.t * depth_scale, 0.0, 1.0);
}
