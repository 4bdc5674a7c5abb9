// The looks: colours of a point of the surface, scene-linear Rec.709. addon/render/shading.py has the same formulas; a test
// holds one against the other. The numbers of the styles and the colours of speeds are constants from look.py.

const float PI = 3.14159265;
const float DIELECTRIC = 0.04;
const float GREY_BEHIND = 0.25;

struct LookInput {
    // Unit, view space: x to the right, y up, z to the eye.
    vec3 normal;
    vec3 to_eye;
    vec3 up;
    vec3 world_normal;
    vec3 base;
    // World space, Blender units a second.
    vec3 velocity;
    float depth;
    float ball;
    // Length of the way through the fluid, Blender units.
    float thickness;
    // Factor of the light, from the depth contrast.
    float contrast;
};

struct LookSettings {
    float ambient;
    float roughness;
    float metallic;
    // Unit, view space, towards the key light.
    vec3 light;
    float light_strength;
    float absorption;
    float ior;
    vec2 depth_range;
    vec2 speed_range;
};

// Trowbridge and Reitz's distribution of facets (GGX), with the usual approximation of what they hide (Karis 2013).
float highlight(vec3 normal, vec3 to_eye, vec3 light, float roughness) {
    vec3 between = normalize(to_eye + light);
    float alpha = max(roughness * roughness, 0.002);
    float cosine = max(dot(normal, between), 0.0);
    float spread = cosine * cosine * (alpha * alpha - 1.0) + 1.0;
    float near = max(dot(light, between), 0.1);
    float facets = alpha * alpha / (4.0 * PI * spread * spread * near * near * (alpha + 0.5));
    return min(facets * max(dot(normal, light), 0.0), 16.0);
}

vec3 schlick(float cosine, vec3 straight) {
    float grazing = 1.0 - clamp(cosine, 0.0, 1.0);
    return straight + (1.0 - straight) * grazing * grazing * grazing * grazing * grazing;
}

// What of unpolarized light a smooth surface reflects (Fresnel).
float fresnel(float cosine, float ior) {
    float within = sqrt(max(1.0 - (1.0 - cosine * cosine) / (ior * ior), 0.0));
    float across = (cosine - ior * within) / (cosine + ior * within);
    float along = (ior * cosine - within) / (ior * cosine + within);
    return 0.5 * (across * across + along * along);
}

// A studio: floor and ceiling, and a soft box around the key light.
vec3 studio_room(vec3 direction, vec3 light, float roughness) {
    vec3 room = mix(vec3(0.10, 0.10, 0.11), vec3(0.55, 0.60, 0.68), smoothstep(-0.6, 0.9, direction.y));
    float blur = 0.04 + 0.5 * roughness;
    float box = smoothstep(0.86 - blur, 0.86 + blur, dot(direction, light));
    return room + vec3(1.9, 1.85, 1.75) * box * (1.0 - 0.6 * roughness);
}

vec3 studio(LookInput seen, LookSettings look, vec3 normal) {
    float cosine = dot(normal, seen.to_eye);
    float key = clamp((dot(normal, look.light) + 0.25) / 1.25, 0.0, 1.0);
    vec3 from_below = normalize(vec3(-look.light.x, -0.35, 0.55));
    float fill = clamp(dot(normal, from_below), 0.0, 1.0);
    vec3 soft = mix(vec3(0.45, 0.42, 0.40), vec3(0.85, 0.92, 1.0), 0.5 + 0.5 * normal.y);
    vec3 diffuse = (1.0 - look.ambient) * (0.95 * key * key * vec3(1.0, 0.97, 0.92) + 0.18 * fill * vec3(0.7, 0.85, 1.0));
    vec3 mirrored = reflect(-seen.to_eye, normal);
    vec3 straight = mix(vec3(DIELECTRIC), seen.base, look.metallic);
    vec3 gloss = schlick(cosine, straight) * (1.0 - 0.7 * look.roughness) * studio_room(mirrored, look.light, look.roughness);
    gloss += schlick(dot(look.light, normalize(look.light + seen.to_eye)), straight)
             * highlight(normal, seen.to_eye, look.light, look.roughness);
    return look.light_strength * seen.contrast * ((1.0 - look.metallic) * seen.base * ((0.3 + look.ambient) * soft + diffuse) + gloss);
}

// Over open ground; `up` is the cosine to the zenith.
vec3 sky(float up) {
    vec3 above = mix(vec3(0.80, 0.86, 0.92), vec3(0.20, 0.40, 0.75), pow(clamp(up, 0.0, 1.0), 0.6));
    return mix(vec3(0.16, 0.17, 0.16), above, smoothstep(-0.25, 0.05, up));
}

// What the surface adds, and in w the share of what is behind that it covers.
vec4 water(LookInput seen, LookSettings look, vec3 normal) {
    float reflected = fresnel(max(dot(normal, seen.to_eye), 1e-3), look.ior);
    float sun = highlight(normal, seen.to_eye, look.light, 0.05 + 0.6 * look.roughness);
    vec3 mirrored = normalize(mix(reflect(-seen.to_eye, normal), normal, look.roughness * look.roughness));
    vec3 passes = exp(-look.absorption * seen.thickness * (1.0 - clamp(seen.base, 0.0, 1.0)));
    float mean = dot(passes, vec3(1.0 / 3.0));
    float key = clamp((dot(normal, look.light) + 0.5) / 1.5, 0.0, 1.0);
    vec3 lit = (0.4 + 1.6 * key * key) * sky(0.5 + 0.5 * dot(normal, seen.up));
    vec3 within = (1.0 - passes) * clamp(seen.base, 0.0, 1.0) * lit;
    // What is behind is dimmed as a whole where it is drawn over; its tint is that of a grey.
    vec3 tint = (passes - mean) * GREY_BEHIND;
    vec3 color = reflected * sky(dot(mirrored, seen.up)) + reflected * 12.0 * sun + (1.0 - reflected) * within;
    color = look.light_strength * seen.contrast * color + (1.0 - reflected) * tint;
    return vec4(max(color, 0.0), 1.0 - (1.0 - reflected) * mean);
}

vec3 speed_color(float place) {
    float part = clamp(place, 0.0, 1.0) * 4.0;
    if (part < 1.0)
        return mix(SPEED_0, SPEED_1, part);
    if (part < 2.0)
        return mix(SPEED_1, SPEED_2, part - 1.0);
    if (part < 3.0)
        return mix(SPEED_2, SPEED_3, part - 2.0);
    return mix(SPEED_3, SPEED_4, part - 3.0);
}

// A permuted congruential generator's step (O'Neill 2014).
uint scrambled(uint number) {
    uint state = number * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

vec3 id_color(float ball) {
    uint number = scrambled(uint(max(ball, 0.0)));
    float hue = float(number & 65535u) / 65536.0 * 6.0;
    float saturation = 0.5 + 0.45 * float((number >> 16u) & 255u) / 255.0;
    float value = 0.7 + 0.3 * float(number >> 24u) / 255.0;
    vec3 pure = clamp(abs(mod(hue + vec3(0.0, 4.0, 2.0), 6.0) - 3.0) - 1.0, 0.0, 1.0);
    vec3 color = value * mix(vec3(1.0), pure, saturation);
    return color * color;
}

float share_of_range(float value, vec2 range) {
    return clamp((value - range.x) / max(range.y - range.x, 1e-12), 0.0, 1.0);
}

// Premultiplied.
vec4 look_color(int style, LookInput seen, LookSettings look) {
    vec3 normal = dot(seen.normal, seen.to_eye) < 0.0 ? -seen.normal : seen.normal;
    if (style == STYLE_WATER)
        return water(seen, look, normal);
    vec3 color = seen.base;
    if (style == STYLE_STUDIO) {
        color = studio(seen, look, normal);
    } else if (style == STYLE_HEADLIGHT) {
        color *= seen.contrast * mix(dot(normal, seen.to_eye), 1.0, look.ambient);
    } else if (style == STYLE_NORMAL) {
        color = pow(0.5 + 0.5 * clamp(seen.world_normal, -1.0, 1.0), vec3(2.2));
    } else if (style == STYLE_DEPTH) {
        color = vec3(pow(1.0 - 0.9 * share_of_range(seen.depth, look.depth_range), 2.2));
    } else if (style == STYLE_SPEED) {
        color = speed_color(share_of_range(length(seen.velocity), look.speed_range));
    } else if (style == STYLE_ID) {
        color = id_color(seen.ball);
    }
    return vec4(color, 1.0);
}
