// Materials, lights and the world, and what surfaces send of their light; docs/light.md has the formulas.
// The scene is a list of vectors of four: MATERIAL_TEXELS for each material, then LIGHT_TEXELS for each light.
// WITH_WORLD_IMAGE: whether the world has an image, else it is of one colour.
#include "lib/random.glsl"

#if WITH_STORAGE
layout(std430, binding = 6) readonly buffer SceneTexels {
    vec4 scene_texels[];
};
#else
uniform samplerBuffer scene_tx;
#endif

uniform uint material_count;
uniform uint light_count;
uniform vec3 world_color;
#if WITH_WORLD_IMAGE
uniform sampler2D world_tx;      // equirectangular radiance
uniform sampler2D irradiance_tx; // of what faces each direction, divided by pi
uniform mat3 image_from_world;
#endif

const float PI = 3.14159265359;
const float ENDLESS = 3e38;
const uint SUN = 0u, SPOT = 2u, AREA = 3u; // a point light is 1

vec4 scene_texel(uint index) {
#if WITH_STORAGE
    return scene_texels[index];
#else
    return texelFetch(scene_tx, int(index));
#endif
}

struct Material {
    vec3 color;
    vec3 emission;
    vec3 absorption;
    float metallic;
    float roughness;
    float transmission;
    float ior; // of what is behind the surface, over what is before it
};

Material light_material(uint index) {
    uint first = uint(MATERIAL_TEXELS) * index;
    vec4 a = scene_texel(first), b = scene_texel(first + 1u), c = scene_texel(first + 2u), d = scene_texel(first + 3u);
    return Material(a.xyz, b.xyz, c.xyz, a.w, b.w, c.w, d.x);
}

struct Light {
    uint kind;
    vec3 position;
    vec3 direction;
    vec3 power;
    float radius;
    float area;
    vec2 cone; // cosine of its border, and the share of it that is soft
    vec3 across; // the sides of an area light
    vec3 up;
    bool is_round;
    bool casts_shadow;
};

Light light_source(uint index) {
    uint first = uint(MATERIAL_TEXELS) * material_count + uint(LIGHT_TEXELS) * index;
    vec4 a = scene_texel(first), b = scene_texel(first + 1u), c = scene_texel(first + 2u), d = scene_texel(first + 3u);
    vec4 e = scene_texel(first + 4u);
    uint flags = uint(e.w);
    vec3 up = cross(e.xyz, b.xyz);
    return Light(uint(a.w), a.xyz, b.xyz, c.xyz, b.w, c.w, d.xy, d.z * e.xyz, d.w * up, (flags & 1u) != 0u, (flags & 2u) != 0u);
}

// Light from a point of a light.
struct Shine {
    vec3 toward; // unit
    float distance;
    vec3 irradiance; // of what faces it; 0 where it does not shine
};

// What of its light a spot sends at an angle to its axis, given its cosine; all where it is no spot.
float light_cone_share(Light light, float cosine) {
    if (light.kind != SPOT)
        return 1.0;
    float soft = max((1.0 - light.cone.x) * light.cone.y, 1e-6);
    float place = clamp((cosine - light.cone.x) / soft, 0.0, 1.0);
    return place * place * (3.0 - 2.0 * place);
}

// Such that the mean over all points of the square is the light of the whole. A sun is a disc in the sky, a point or a spot light a
// sphere: both send the same radiance from everywhere on the side that is seen. Of an area light every point is as likely.
Shine light_shine(Light light, vec3 position, vec2 point) {
    if (light.kind == SUN) {
        float half_sine = sin(0.5 * light.radius);
        float flat_part = 2.0 * half_sine * half_sine;
        vec3 toward = random_along(-light.direction, random_in_cone(point, flat_part));
        return Shine(toward, ENDLESS, light.power * (2.0 / (2.0 - flat_part)));
    }
    vec3 way = light.position - position;
    if (light.kind == AREA) {
        vec2 place = light.is_round ? 0.5 * sqrt(point.x) * vec2(cos(TAU * point.y), sin(TAU * point.y)) : point - 0.5;
        way += place.x * light.across + place.y * light.up;
        float squared = dot(way, way);
        vec3 toward = way / sqrt(squared);
        return Shine(toward, sqrt(squared), light.power * max(-dot(toward, light.direction), 0.0) / (PI * squared));
    }
    float squared = dot(way, way), far = sqrt(squared);
    if (far <= light.radius)
        return Shine(vec3(0.0, 0.0, 1.0), 0.0, vec3(0.0));
    vec3 middle = way / far;
    float sine = light.radius / far, cosine = sqrt(1.0 - sine * sine);
    vec3 local = random_in_cone(point, sine * sine / (1.0 + cosine));
    // Where the way meets the sphere first.
    float half_chord = sqrt(max(light.radius * light.radius - squared * dot(local.xy, local.xy), 0.0));
    float share = light_cone_share(light, -dot(middle, light.direction)) / (2.0 * PI * squared * (1.0 + cosine));
    return Shine(random_along(middle, local), far * local.z - half_chord, light.power * share);
}

// The radiance that a ray meets in a light before it meets anything at a distance.
vec3 light_seen(Light light, vec3 origin, vec3 direction, float end) {
    vec3 way = light.position - origin;
    float share = 0.0;
    if (light.kind == SUN) {
        float sine = sin(light.radius);
        if (light.radius > 0.0 && end >= ENDLESS && length(direction + light.direction) <= 2.0 * sin(0.5 * light.radius))
            share = 1.0 / (PI * sine * sine);
    } else if (light.kind == AREA) {
        float cosine = -dot(direction, light.direction);
        float distance = cosine > 0.0 ? -dot(way, light.direction) / cosine : 0.0;
        vec3 place = distance * direction - way;
        vec2 at = vec2(dot(place, light.across), dot(place, light.up));
        at /= max(vec2(dot(light.across, light.across), dot(light.up, light.up)), 1e-30);
        bool is_within = light.is_round ? dot(at, at) <= 0.25 : all(lessThanEqual(abs(at), vec2(0.5)));
        if (light.area > 0.0 && distance > 0.0 && distance < end && is_within)
            share = 1.0 / (PI * light.area);
    } else if (light.radius > 0.0) {
        float middle = dot(way, direction), radius_2 = light.radius * light.radius;
        vec3 apart = way - middle * direction;
        float half_chord_2 = radius_2 - dot(apart, apart);
        float distance = middle - sqrt(max(half_chord_2, 0.0));
        if (half_chord_2 >= 0.0 && dot(way, way) > radius_2 && distance > 0.0 && distance < end)
            share = light_cone_share(light, -dot(normalize(way), light.direction)) / (4.0 * PI * PI * radius_2);
    }
    return share * light.power;
}

// The sine of half the angle that a light is seen under.
float light_extent(Light light, vec3 position) {
    if (light.kind == SUN)
        return sin(light.radius);
    float size = light.kind == AREA ? sqrt(light.area / PI) : light.radius;
    return size / max(distance(light.position, position), 1e-12);
}

#if WITH_WORLD_IMAGE
// Between the centres of pixels; the middle of the image is seen along x, a quarter of the width along y, the top row along z.
vec3 light_in_image(sampler2D image, vec3 direction) {
    vec3 place = image_from_world * direction;
    ivec2 size = textureSize(image, 0);
    float column = (0.5 - atan(place.y, place.x) / TAU) * float(size.x) - 0.5;
    float row = clamp((1.0 - acos(clamp(place.z, -1.0, 1.0)) / PI) * float(size.y) - 0.5, 0.0, float(size.y - 1));
    vec2 corner = floor(vec2(column, row)), share = vec2(column, row) - corner;
    // From -1 to the width.
    int left = (int(corner.x) + size.x) % size.x, right = (left + 1) % size.x;
    int low = int(corner.y), high = min(low + 1, size.y - 1);
    vec3 below = mix(texelFetch(image, ivec2(left, low), 0).rgb, texelFetch(image, ivec2(right, low), 0).rgb, share.x);
    vec3 above = mix(texelFetch(image, ivec2(left, high), 0).rgb, texelFetch(image, ivec2(right, high), 0).rgb, share.x);
    return mix(below, above, share.y);
}
#endif

// What comes from a direction.
vec3 light_of_world(vec3 direction) {
#if WITH_WORLD_IMAGE
    return light_in_image(world_tx, direction);
#else
    return world_color;
#endif
}

// The irradiance of a surface with this normal, divided by pi.
vec3 light_on_normal(vec3 normal) {
#if WITH_WORLD_IMAGE
    return light_in_image(irradiance_tx, normal);
#else
    return world_color;
#endif
}

float light_alpha(float roughness) {
    return roughness * roughness;
}

// What becomes of light that meets facets; the rest is lost in metal.
struct Met {
    vec3 reflected;
    float entering;
};

// Given the cosine of the angle to the facets; Fresnel's formulas for unpolarised light, and Schlick's curve for metal. Of what they
// reflect a share is `shown`; the rest is hidden by others, which metal reflects once more, on average over all angles.
Met light_meet(Material material, float cosine, float shown) {
    float x = clamp(cosine, 1e-3, 1.0), eta = material.ior;
    float y = sqrt(max(1.0 - (1.0 - x * x) / (eta * eta), 0.0));
    float across = (x - eta * y) / (x + eta * y), along = (eta * x - y) / (eta * x + y);
    float dielectric = 0.5 * (across * across + along * along);
    vec3 again = material.color + (1.0 - material.color) / 21.0;
    vec3 metal = (material.color + (1.0 - material.color) * pow(1.0 - x, 5.0)) * mix(again, vec3(1.0), shown);
    return Met(dielectric + material.metallic * (metal - dielectric), (1.0 - material.metallic) * (1.0 - dielectric));
}

// The share of what a facet mirrors that others do not hide, given the cosines of the angles of both directions to the normal
// (Smith; Heitz 2014).
float light_shown(float alpha, float to_eye, float mirrored) {
    if (mirrored <= 0.0)
        return 0.0;
    vec2 cosines = clamp(vec2(to_eye, mirrored), 1e-3, 1.0);
    vec2 squares = cosines * cosines;
    vec2 hidden = 0.5 * (sqrt(1.0 + alpha * alpha * (1.0 - squares) / squares) - 1.0);
    return (1.0 + hidden.x) / (1.0 + hidden.x + hidden.y);
}

// What of a light's irradiance facets send to the eye: Trowbridge and Reitz's distribution (GGX), with the usual approximation of
// what they hide (Karis 2013).
float light_facets(float roughness, float cosine, float near, float facing) {
    float alpha = max(roughness * roughness, 0.002), squared = alpha * alpha;
    cosine = max(cosine, 0.0);
    near = max(near, 0.1);
    float spread = cosine * cosine * (squared - 1.0) + 1.0;
    return min(squared / (4.0 * PI * spread * spread * near * near * (alpha + 0.5)) * facing, 16.0);
}

// The share of a light's irradiance that is sent to the eye: of what is `matt` as it is seen through the surface, and by facets
// where `with_gloss`.
vec3 light_sent(Material material, vec3 matt, vec3 normal, vec3 to_eye, vec3 toward, bool with_gloss) {
    float facing = max(dot(normal, toward), 0.0);
    vec3 between = normalize(to_eye + toward);
    float near = dot(toward, between);
    vec3 sent = matt * (facing / PI);
    if (with_gloss)
        sent += light_meet(material, near, 1.0).reflected * light_facets(material.roughness, dot(normal, between), near, facing);
    return sent;
}
