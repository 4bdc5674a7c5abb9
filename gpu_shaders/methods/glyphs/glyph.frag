// The number of the nearest glyph; 0 stands for none.
#include "lib/conservative_depth.glsl"
#include "methods/glyphs/glyph.glsl"

uniform float depth_scale;
uniform vec2 clip_distances; // planar

flat in int v_number;
flat in vec4 v_glyph[GLYPH_TEXELS];

layout(location = 0) out uint out_number;

void main() {
    Meeting meeting = glyph_meeting(glyph_unpack(v_glyph), ray_from_pixel(gl_FragCoord.xy), clip_distances);
    if (!meeting.is_met)
        discard;
    gl_FragDepth = meeting.depth * depth_scale;
    out_number = uint(v_number) + 1u;
}
