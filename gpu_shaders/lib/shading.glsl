struct LookInput { vec3 normal; vec3 to_eye; vec3 world_normal; vec3 base; vec3 velocity; vec3 up; float depth; float ball; float thickness; };
struct LookSettings { float ambient; float roughness; vec3 light; float light_strength; vec3 extinction; float ior; vec2 depth_range; vec2 speed_range; };
vec4 look_color(int style, LookInput seen, LookSettings settings) {
    if (style == 3) return vec4(seen.base, 1.0);
    return vec4(seen.base * (settings.ambient + (1.0 - settings.ambient) * abs(dot(seen.normal, seen.to_eye))), 1.0);
}
