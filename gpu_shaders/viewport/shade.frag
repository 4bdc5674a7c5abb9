// Colours a sample as the look wants it, in linear light of an sRGB display, premultiplied.
#include "lib/shading.glsl"
#include "lib/display.glsl"

const float BACKGROUND = 1e10;

// View space, x and y at distance 1 from the eye or across an orthographic view.
vec2 position_in_window(vec2 pixel, vec2 size) {
    return mix(params.window.xy, params.window.zw, pixel / size);
}

vec3 to_eye(vec2 position) {
    return params.surface.w > 0.5 ? normalize(vec3(-position, 1.0)) : vec3(0.0, 0.0, 1.0);
}

float thickness_at(vec2 place) {
    if (params.display.w < 0.5)
        return 0.0;
    ivec2 last = textureSize(thickness_tx, 0) - 1;
    vec2 position = place * vec2(last + 1) - 0.5;
    ivec2 low = ivec2(floor(position));
    vec2 share = position - vec2(low);
    float values[4];
    for (int corner = 0; corner < 4; ++corner)
        values[corner] = texelFetch(thickness_tx, clamp(low + ivec2(corner & 1, corner >> 1), ivec2(0), last), 0).x;
    return mix(mix(values[0], values[1], share.x), mix(values[2], values[3], share.x), share.y);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec2 size = vec2(textureSize(depth_tx, 0));
    float depth = texelFetch(depth_tx, pixel, 0).x;
    if (depth >= BACKGROUND) {
        out_color = vec4(0.0);
        return;
    }
    vec4 value = texelFetch(value_tx, pixel, 0);
    mat3 view_from_world = transpose(mat3(params.world_from_view));
    LookInput seen;
    seen.world_normal = texelFetch(normal_tx, pixel, 0).xyz;
    seen.normal = view_from_world * seen.world_normal;
    seen.to_eye = to_eye(position_in_window(gl_FragCoord.xy, size));
    seen.base = params.base.w > 0.5 ? value.rgb : params.base.rgb;
    seen.velocity = value.xyz;
    seen.ball = value.x;
    seen.depth = depth;
    seen.thickness = thickness_at(gl_FragCoord.xy / size);
    seen.contrast = params.optics.w > 0.0 ? 1.0 + tanh(params.optics.w * texelFetch(importance_tx, pixel, 0).x) : 1.0;
    seen.up = view_from_world * vec3(0.0, 0.0, 1.0);
    LookSettings settings;
    settings.ambient = params.surface.x;
    settings.roughness = params.surface.y;
    settings.metallic = params.optics.z;
    settings.light = params.light.xyz;
    settings.light_strength = params.light.w;
    settings.absorption = params.optics.x;
    settings.ior = params.optics.y;
    settings.depth_range = params.ranges.xy;
    settings.speed_range = params.ranges.zw;
    int style = int(params.surface.z + 0.5);
    // Materials are shaded before.
    vec4 color = style == STYLE_MATERIAL ? value : look_color(style, seen, settings);
    out_color = vec4(displayed(color.rgb / max(color.a, 1e-6)) * color.a, color.a);
}
