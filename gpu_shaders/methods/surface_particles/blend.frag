// Adds what a disc says to the pixels where it is in front, weighted by the distance from its middle, by blending (section 7.6).
#include "methods/surface_particles/disc.glsl"
#include "methods/surface_particles/front.glsl"
#include "methods/surface_particles/ray_start.glsl"

// What lies farther behind the nearest disc than this, in radii of the disc, is another sheet.
const float BLEND_BEHIND = 0.5;

flat in vec4 v_place;
flat in vec4 v_normal;
flat in vec4 v_along;
flat in vec4 v_across;

layout(location = 0) out vec4 out_normal_sum; // weighted normals, weights
layout(location = 1) out float out_way_sum;   // weighted distances behind the nearest disc

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Disc disc = disc_unpack(v_place, v_normal, v_along, v_across);
    Meeting meeting = disc_meeting(disc, ray_from_pixel(gl_FragCoord.xy), starts_inside(pixel));
    float behind = meeting.t - front_distance(pixel);
    if (!meeting.is_met || behind < 0.0 || behind > BLEND_BEHIND * disc.radius)
        discard;
    out_normal_sum = meeting.weight * vec4(meeting.normal, 1.0);
    out_way_sum = meeting.weight * behind;
}
