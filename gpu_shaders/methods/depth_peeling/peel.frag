// The next influence sphere that the pixel's ray enters behind the last one; the depth test keeps the nearest. Spheres are
// drawn in the order of their ids, so among equal distances the first, which has the least number, stays.
#include "lib/conservative_depth.glsl"
#include "lib/chord.glsl"
#include "methods/depth_peeling/clip.glsl"

uniform usampler2D state_tx;

flat in uint v_id;
flat in vec4 v_sphere;
layout(location = 0) out uint out_crossing;

void main() {
    State last = state_unpack(texelFetch(state_tx, ivec2(gl_FragCoord.xy), 0).xy);
    if (last.phase != PHASE_PEELING)
        discard;
    Ray ray = ray_from_pixel(gl_FragCoord.xy);
    Chord chord = ball_chord(Ball(v_sphere.xyz, v_sphere.w), ray);
    float half_length = chord_half_length(chord);
    float start = clip_start(ray);
    float entry = max((chord.middle - half_length) * depth_scale, start);
    float exit = (chord.middle + half_length) * depth_scale;
    uint number = v_id + 1u;
    bool is_next = entry > last.depth || (entry == last.depth && number > last.crossing);
    if (chord.peak <= 0.0 || exit <= start || entry > clip_end(ray) || !is_next)
        discard;
    out_crossing = number;
    gl_FragDepth = entry;
}
