// The glyphs, as a texture gives them.
#include "methods/glyphs/glyph.glsl"

uniform sampler2D glyph_tx; // GLYPH_TEXELS for each

void glyph_fetch(int glyph, out vec4 texels[GLYPH_TEXELS]) {
    for (int part = 0; part < GLYPH_TEXELS; part++)
        texels[part] = texelFetch(glyph_tx, glyph_texel(GLYPH_TEXELS * glyph + part), 0);
}
