// Glyphs, and where rays meet them.
#include "lib/ray.glsl"

// A glyph is what `glyph_unit_from_view` makes the unit sphere about the origin, when its centre is moved there.
struct Glyph {
    vec3 center;
#if ELLIPSOIDS
    mat3 axes;    // columns: unit, view space
    vec3 lengths; // of the semi-axes
#else
    float radius;
#endif
};

#if ELLIPSOIDS
#define GLYPH_TEXELS 4
#else
#define GLYPH_TEXELS 1
#endif

// Centre, and the radius of a sphere; then the direction and length of each semi-axis of an ellipsoid. View space.
Glyph glyph_unpack(vec4 texels[GLYPH_TEXELS]) {
#if ELLIPSOIDS
    mat3 axes = mat3(texels[1].xyz, texels[2].xyz, texels[3].xyz);
    return Glyph(texels[0].xyz, axes, vec3(texels[1].w, texels[2].w, texels[3].w));
#else
    return Glyph(texels[0].xyz, texels[0].w);
#endif
}

ivec2 glyph_texel(int number) {
    return ivec2(number % ROW_TEXTURE_WIDTH, number / ROW_TEXTURE_WIDTH);
}

// A vector where the glyph is the unit sphere: its parts along the axes, by their lengths.
vec3 glyph_unit_from_view(Glyph glyph, vec3 vector) {
#if ELLIPSOIDS
    return vector * glyph.axes / glyph.lengths;
#else
    return vector / glyph.radius;
#endif
}

// Where a ray meets a glyph: unit space is where it is the unit sphere.
struct Meeting {
    bool is_met; // between the clip distances
    float depth; // planar
    vec3 place;  // unit space
};

// The nearest point of the surface between planar depths; a ray that starts in the glyph meets it from within.
Meeting glyph_meeting(Glyph glyph, Ray ray, vec2 clip) {
    float center_depth = -glyph.center.z;
    // From the centre to the ray in the plane of the centre's depth: the only subtraction of large numbers.
    vec3 offset = vec3(ray.origin + center_depth * ray.slope - glyph.center.xy, 0.0);
    vec3 start = glyph_unit_from_view(glyph, offset);
    vec3 direction = glyph_unit_from_view(glyph, vec3(ray.slope, -1.0));
    float length_2 = dot(direction, direction);
    // How far the line passes the centre; of the difference of two squares nothing would remain.
    vec3 apart = cross(start, direction);
    float rest = 1.0 - dot(apart, apart) / length_2;
    float middle = -dot(start, direction) / length_2;
    float half_length = sqrt(max(rest, 0.0) / length_2);
    float way = middle - half_length;
    if (center_depth + way < clip.x)
        way = middle + half_length;
    float depth = center_depth + way;
    return Meeting(rest >= 0.0 && depth >= clip.x && depth <= clip.y, depth, start + way * direction);
}

// The unit normal at a place in unit space, in view space.
vec3 glyph_normal(Glyph glyph, vec3 place) {
#if ELLIPSOIDS
    // Of a longer axis there is less in the normal than in the place.
    return glyph.axes * normalize(place * (min(min(glyph.lengths.x, glyph.lengths.y), glyph.lengths.z) / glyph.lengths));
#else
    return normalize(place);
#endif
}
