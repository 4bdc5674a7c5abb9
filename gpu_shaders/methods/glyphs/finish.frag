// The surface as the renderer wants it, of the glyph that each pixel sees.
#include "lib/outputs.glsl"
#include "methods/glyphs/glyph_texture.glsl"

uniform usampler2D number_tx; // 0 for none
uniform vec2 clip_distances;  // planar
uniform mat3 world_from_view;
#if WITH_COLORS
uniform sampler2D color_tx;
#endif
#if WITH_VELOCITIES
uniform sampler2D velocity_tx;
#endif
#if WITH_BALLS
uniform isampler2D ball_tx;
#endif

void main() {
    int index = int(texelFetch(number_tx, ivec2(gl_FragCoord.xy), 0).x) - 1;
    bool is_hit = index >= 0;
    out_depth = DEPTH_BACKGROUND;
    out_normal = vec4(0.0);
    if (is_hit) {
        vec4 texels[GLYPH_TEXELS];
        glyph_fetch(index, texels);
        Glyph glyph = glyph_unpack(texels);
        Meeting meeting = glyph_meeting(glyph, ray_from_pixel(gl_FragCoord.xy), clip_distances);
        out_depth = min(meeting.depth, DEPTH_BACKGROUND);
        out_normal = vec4(world_from_view * glyph_normal(glyph, meeting.place), 1.0);
    }
#if WITH_COLORS
    out_color = is_hit ? vec4(texelFetch(color_tx, glyph_texel(index), 0).rgb, 1.0) : vec4(0.0);
#endif
#if WITH_VELOCITIES
    out_velocity = is_hit ? vec4(texelFetch(velocity_tx, glyph_texel(index), 0).rgb, 1.0) : vec4(0.0);
#endif
#if WITH_BALLS
    out_ball = is_hit ? texelFetch(ball_tx, glyph_texel(index), 0).x : -1;
#endif
}
