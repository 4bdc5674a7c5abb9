// Light followed back from the eye through the surface of a pixel: shadows, reflections, refraction, ambient occlusion. docs/light.md
// has the formulas. A path is followed to its end before the next one; of both ways at a surface one waits.
// WITH_MESHES: whether there are any beside the fluid. LETS_PASS: whether any material lets light pass. WITH_SOURCES: whether balls differ in their materials. Rays begin on a known side
// of the surface, so it is not asked.
#include "lib/light.glsl"
#include "lib/tree_camera.glsl"
#include "lib/tree_surface.glsl"
#if WITH_MESHES
#include "lib/triangle_tree.glsl"
#endif

#if WITH_SOURCES
#if WITH_STORAGE
layout(std430, binding = 7) readonly buffer Sources {
    int sources[];
};
#else
uniform isamplerBuffer sources_tx;
#endif
#endif

uniform vec2 clip_depths;     // planar, less that of the anchor
uniform vec2 radius_range;    // least and greatest of the balls
uniform int most_reflections; // how many mirrors light may meet, and how many surfaces it may pass
uniform int most_refractions;
uniform uint occlusion_count; // rays that ask how much of the world is seen; 0 for all of it
uniform float occlusion_distance;
uniform bool has_shadows;
uniform bool is_film_clear;
uniform uint sample_count;
uniform uint first_sample;

// Paths that have met so many surfaces follow one way of those that open up, not both; so many may wait.
const int SPLITS = 2;
const uint MOST_WAITING = 3u;
const uint MOST_FLIGHTS = 1000u;

// What is left of light that is not worth another ray.
const float DIM = 1e-4;

// How far, in influence radii, methods may have found the surface from where it is, and as a share of the distance.
const float METHOD_ERROR = 0.02;
const float DEPTH_ERROR = 4e-6;

// How far rays begin off the surface: where the field is surely on one side of the isovalue, relatively; in radii, at most where it
// is level, and by what distances are off.
const float SURELY_OFF = 1e-5;
const float MOST_LIFT = 1e-3;
const float DISTANCE_OFF = 1e-6;
// And by what points on rays are off where they are rounded, as a share of their coordinates and of those of the ray's start.
const float ROUNDING = 4e-7;

// What random numbers are used for; lights follow.
const uint FACET = 0u, CHOICE = 1u, OCCLUSION = 2u, REFLECTION = 3u, REFRACTION = 4u, LIGHTS = 5u;

const int AIR = -1;

// A ray on its way.
struct Flight {
    vec3 origin;
    vec3 direction;
    vec3 light; // the share of the light that it finds
    // The greatest width of facets that mirrored it from outside; smaller lights are not seen behind them: they would be sparks.
    float spread;
    uint seed;
    int reflections;
    int refractions;
    bool is_straight; // passed all surfaces that it met
    bool is_inside;   // begins inside the fluid
    int medium;       // the material that it goes through, or AIR
};

// A point of a surface that is to be shaded.
struct Vertex {
    vec3 position;
    vec3 normal;    // for light, on the side of the ray
    vec3 geometric; // that of the surface itself, on the same side
    float lift;
    bool is_within; // seen from within
    bool is_inside; // before it is fluid, whatever it is itself
    bool is_fluid;  // it is the fluid's surface
    int medium;     // before it
    int index;      // of its material
    Material material;
};

vec4 waiting_origin[MOST_WAITING]; // and spread
vec3 waiting_direction[MOST_WAITING];
vec3 waiting_light[MOST_WAITING];
uvec2 waiting_bits[MOST_WAITING];
uint waiting_count = 0u;
vec3 radiance;
vec3 behind; // the share of what lies behind everything

void trace_push(Flight flight) {
    uint place = min(waiting_count, MOST_WAITING - 1u);
    waiting_origin[place] = vec4(flight.origin, flight.spread);
    waiting_direction[place] = flight.direction;
    waiting_light[place] = flight.light;
    uint flags = uint(flight.is_straight) | uint(flight.is_inside) << 1u | uint(flight.reflections) << 2u;
    waiting_bits[place] = uvec2(flight.seed, flags | uint(flight.refractions) << 9u | uint(flight.medium + 1) << 16u);
    waiting_count++;
}

Flight trace_pop() {
    waiting_count--;
    uint place = min(waiting_count, MOST_WAITING - 1u);
    uvec2 bits = waiting_bits[place];
    return Flight(waiting_origin[place].xyz, waiting_direction[place], waiting_light[place], waiting_origin[place].w, bits.x,
                  int(bits.y >> 2u & 127u), int(bits.y >> 9u & 127u), (bits.y & 1u) != 0u, (bits.y & 2u) != 0u,
                  int(bits.y >> 16u) - 1);
}

int ball_source(int id) {
#if !WITH_SOURCES
    return 0;
#elif WITH_STORAGE
    return sources[id];
#else
    return texelFetch(sources_tx, id).x;
#endif
}

// What is left of light after a way through a medium (Beer).
vec3 trace_absorbed(int medium, float way) {
    return medium == AIR || way >= ENDLESS ? vec3(1.0) : exp(-light_material(uint(medium)).absorption * way);
}

// Adds what the world sends; where the film is clear, what lies behind the picture is seen instead.
void trace_escape(Flight flight) {
    if (flight.is_straight && is_film_clear)
        behind += flight.light;
    else
        radiance += flight.light * light_of_world(flight.direction);
}

// Adds the lights that a ray sees before it ends.
void trace_see_lights(Flight flight, float end) {
    for (uint i = 0u; i < light_count; i++) {
        Light light = light_source(i);
        if (light_extent(light, flight.origin) > flight.spread)
            radiance += flight.light * light_seen(light, flight.origin, flight.direction, end);
    }
}

float trace_rounding(vec3 start, vec3 point) {
    vec3 most = max(abs(start), abs(point));
    return ROUNDING * max(max(most.x, most.y), most.z);
}

// A point of the surface, seen along a ray.
Vertex trace_vertex(Segment segment, TreeHit hit, int medium) {
    LeafSurface surface = tree_surface(segment, hit);
    int index = surface.ball < 0 ? 0 : ball_source(surface.ball);
    Material material = light_material(uint(index));
#if WITH_COLORS
    material.color = surface.color;
#endif
    vec3 position = segment.start + hit.t * segment.direction;
    float off = surface.steepness > 0.0 ? SURELY_OFF * isovalue / surface.steepness : ENDLESS;
    float lift = min(off, MOST_LIFT * surface.radius) + DISTANCE_OFF * surface.radius + trace_rounding(segment.start, position);
    bool is_within = dot(surface.normal, segment.direction) > 0.0;
    if (is_within)
        material.ior = 1.0 / material.ior;
    vec3 normal = is_within ? -surface.normal : surface.normal;
    return Vertex(position, normal, normal, lift, is_within, is_within, true, medium, index, material);
}

#if WITH_MESHES
// A point of a mesh, seen along a ray.
Vertex trace_mesh_vertex(Segment segment, TriangleHit hit, bool is_inside, int medium) {
    vec3 first = triangle_texel(hit.entry, 3u).xyz, second = triangle_texel(hit.entry, 4u).xyz;
    vec3 third = triangle_texel(hit.entry, 5u).xyz;
    vec3 normal = normalize(first + hit.shares.x * (second - first) + hit.shares.y * (third - first));
    vec3 geometric = dot(normal, hit.normal) < 0.0 ? -hit.normal : hit.normal;
    bool is_within = dot(geometric, segment.direction) > 0.0;
    int index = int(triangle_texel(hit.entry, 0u).w);
    Material material = light_material(uint(index));
    if (is_within)
        material.ior = 1.0 / material.ior;
    float side = is_within ? -1.0 : 1.0;
    vec3 position = segment.start + hit.t * segment.direction;
    float lift = 2.0 * trace_rounding(segment.start, position);
    return Vertex(position, side * normal, side * geometric, lift, is_within, is_inside, false, medium, index, material);
}
#endif

// What a ray meets first.
struct SceneHit {
    float t;
    TreeHit fluid;
    bool is_mesh;
#if WITH_MESHES
    TriangleHit mesh;
#endif
};

// As tree_cast, of fluid and meshes.
bool trace_cast(Segment segment, float begin, float end, bool asks, bool is_inside, bool takes_any, out SceneHit hit) {
    bool has_met = tree_cast(segment, begin, end, asks, is_inside, takes_any, hit.fluid);
    hit.t = has_met ? hit.fluid.t : end;
    hit.is_mesh = false;
#if WITH_MESHES
    if (!(has_met && takes_any) && triangle_cast(segment, begin, hit.t, takes_any, hit.mesh)) {
        hit.is_mesh = has_met = true;
        hit.t = hit.mesh.t;
    }
#endif
    return has_met;
}

Vertex trace_vertex_of(Segment segment, SceneHit hit, int medium) {
#if WITH_MESHES
    if (hit.is_mesh)
        return trace_mesh_vertex(segment, hit.mesh, hit.fluid.is_inside, medium);
#endif
    return trace_vertex(segment, hit.fluid, medium);
}

// Where a ray from it begins, on the side it is seen from or on the other.
vec3 vertex_leaving(Vertex vertex, bool passes) {
    return vertex.position + (passes ? -vertex.lift : vertex.lift) * vertex.geometric;
}

// Whether it begins in the fluid.
bool vertex_leaving_inside(Vertex vertex, bool passes) {
    return vertex.is_inside != (passes && vertex.is_fluid);
}

// The material behind it.
int vertex_beyond(Vertex vertex) {
    return vertex.is_within ? AIR : vertex.index;
}

// The direction, or its mirror image on the side of a normal.
vec3 trace_toward(vec3 direction, vec3 side) {
    float cosine = dot(direction, side);
    return normalize(cosine < 0.0 ? direction - 2.0 * cosine * side : direction);
}

// The share of a light, or of the world, that reaches a vertex along a ray.
vec3 trace_arriving(Vertex vertex, vec3 direction, float way, bool may_pass) {
    Segment segment = segment_from(vertex_leaving(vertex, false), direction);
    bool is_inside = vertex.is_inside;
    SceneHit hit;
#if LETS_PASS
    vec3 share = vec3(1.0);
    int medium = vertex.medium;
    for (int passed = 0; passed <= min(most_refractions, 64); passed++) {
        if (!trace_cast(segment, 0.0, way, false, is_inside, !may_pass, hit))
            return share * trace_absorbed(medium, way);
        if (!may_pass || passed == most_refractions)
            return vec3(0.0);
        Vertex met_vertex = trace_vertex_of(segment, hit, medium);
        Material material = met_vertex.material;
        Met surface = light_meet(material, -dot(met_vertex.normal, direction), 1.0);
        share *= trace_absorbed(medium, hit.t) * sqrt(max(material.color, 0.0)) * (surface.entering * material.transmission);
        if (share.x + share.y + share.z <= 0.0)
            return vec3(0.0);
        medium = vertex_beyond(met_vertex);
        is_inside = vertex_leaving_inside(met_vertex, true);
        way = way >= ENDLESS ? way : way - hit.t;
        segment = segment_from(vertex_leaving(met_vertex, true), direction);
    }
    return vec3(0.0);
#else
    return vec3(trace_cast(segment, 0.0, way, false, is_inside, true, hit) ? 0.0 : 1.0);
#endif
}

// Adds what lights and the world let a vertex send, of which what is `matt` is seen through its surface.
void trace_gather(Vertex vertex, Flight flight, vec3 matt, uint number) {
    vec3 ambient = flight.light * matt;
    vec3 to_eye = -flight.direction;
    int bounces = min(flight.reflections + flight.refractions, 8);
    // What is seen in mirrors may be noisier.
    bool asks_world = occlusion_count > 0u && any(greaterThan(ambient, vec3(0.0)));
    uint ray_count = asks_world ? max(occlusion_count >> uint(2 * bounces), 1u) : 0u;
    vec3 hidden = vec3(0.0);
    uint question_count = light_count + ray_count;
    for (uint i = 0u; i < question_count; i++) {
        bool is_light = i < light_count, is_asked = true;
        vec3 direction, brings = vec3(0.0);
        float way = occlusion_distance;
        if (is_light) {
            Light light = light_source(i);
            Shine shine = light_shine(light, vertex.position, random_square(random_branch(flight.seed, LIGHTS + i), number));
            // From within the light is not where a straight line says; and facets see lights that are wider than what they gather.
            float spread = max(flight.spread, light_alpha(vertex.material.roughness));
            bool is_gathered = vertex.is_within || light_extent(light, vertex.position) > spread;
            vec3 sent = light_sent(vertex.material, matt, vertex.normal, to_eye, shine.toward, !is_gathered);
            if (dot(shine.toward, vertex.normal) > 0.0)
                brings = flight.light * shine.irradiance * sent;
            direction = shine.toward;
            way = shine.distance;
            is_asked = has_shadows && light.casts_shadow && any(greaterThan(brings, vec3(0.0)));
        } else {
            uint place = number * ray_count + (i - light_count);
            vec2 point = random_square(random_branch(flight.seed, OCCLUSION), place);
            direction = normalize(random_along(vertex.normal, random_by_cosine(point)));
        }
        vec3 share = is_asked ? trace_arriving(vertex, direction, way, is_light) : vec3(1.0);
        if (is_light)
            radiance += brings * share;
        else if (share.x <= 0.0)
            hidden += light_of_world(direction);
    }
    radiance += ambient * max(light_on_normal(vertex.normal) - hidden / float(max(ray_count, 1u)), 0.0);
}

// Sends a ray for the light from a direction; the last of a path sees lights and world at once.
void trace_send(Vertex vertex, Flight flight, bool is_last, bool passes) {
    flight.origin = vertex_leaving(vertex, passes);
    flight.is_inside = vertex_leaving_inside(vertex, passes);
    flight.medium = passes ? vertex_beyond(vertex) : vertex.medium;
    if (!passes && !vertex.is_within)
        flight.spread = max(flight.spread, light_alpha(vertex.material.roughness));
    if (is_last || all(lessThan(flight.light, vec3(DIM)))) {
        trace_see_lights(flight, ENDLESS);
        trace_escape(flight);
    } else {
        trace_push(flight);
    }
}

// Sends rays for what a vertex reflects and lets pass.
void trace_split(Vertex vertex, Flight flight, vec3 facet, vec3 mirrored, vec3 passed, uint number) {
    if (flight.reflections + flight.refractions >= SPLITS) {
        float first = mirrored.x + mirrored.y + mirrored.z, second = passed.x + passed.y + passed.z;
        float share = first + second > 0.0 ? first / (first + second) : 1.0;
        bool mirrors = random_square(random_branch(flight.seed, CHOICE), number).x < share;
        mirrored = mirrors ? mirrored / max(share, 1e-30) : vec3(0.0);
        passed = mirrors ? vec3(0.0) : passed / max(1.0 - share, 1e-30);
    }
    float cosine = dot(flight.direction, facet);
    if (mirrored.x + mirrored.y + mirrored.z > 0.0) {
        Flight next = flight;
        next.direction = trace_toward(flight.direction - 2.0 * cosine * facet, vertex.geometric);
        next.light = mirrored;
        next.seed = random_branch(flight.seed, REFLECTION);
        next.reflections = flight.reflections + 1;
        next.is_straight = false;
        trace_send(vertex, next, flight.reflections >= most_reflections, false);
    }
    if (passed.x + passed.y + passed.z > 0.0) {
        Flight next = flight;
        float ratio = 1.0 / vertex.material.ior;
        float onward = sqrt(max(1.0 - ratio * ratio * (1.0 - cosine * cosine), 0.0));
        next.direction = trace_toward(normalize(ratio * flight.direction - (ratio * cosine + onward) * facet), -vertex.geometric);
        next.light = passed;
        next.seed = random_branch(flight.seed, REFRACTION);
        next.refractions = flight.refractions + 1;
        trace_send(vertex, next, flight.refractions >= most_refractions, true);
    }
}

// The light that a vertex sends by itself, that of lights and the world, and rays for the rest.
void trace_shade(Vertex vertex, Flight flight, uint number) {
    Material material = vertex.material;
    vec3 facet = vertex.normal;
    float shown = 1.0;
    if (material.roughness > 0.0) {
        vec3 local = random_into(vertex.normal, -flight.direction);
        vec2 point = random_square(random_branch(flight.seed, FACET), number);
        vec3 seen = normalize(vec3(local.xy, max(local.z, 1e-6)));
        facet = random_along(vertex.normal, random_facet(seen, light_alpha(material.roughness), point));
        vec3 mirrored = reflect(flight.direction, facet);
        shown = light_shown(light_alpha(material.roughness), local.z, dot(mirrored, vertex.normal));
    }
    Met surface = light_meet(material, -dot(facet, flight.direction), shown);
    radiance += flight.light * material.emission;
    trace_gather(vertex, flight, material.color * ((1.0 - material.transmission) * surface.entering), number);
    vec3 passing = sqrt(max(material.color, 0.0)) * (surface.entering * material.transmission);
    trace_split(vertex, flight, facet, flight.light * surface.reflected, flight.light * passing, number);
}

// Follows what the eye sees at a depth; `outward` is the surface's normal.
void trace_sample(Ray ray, float depth, vec3 outward, uint seed, uint number) {
    Segment segment = tree_camera_segment(ray);
    float t = (depth - anchor_depth) * ray.stretch, error = DEPTH_ERROR * depth * ray.stretch;
    float begin = max(t - METHOD_ERROR * radius_range.y - error, clip_depths.x * ray.stretch);
    float end = t + METHOD_ERROR * radius_range.x + error;
    Flight flight = Flight(segment.start, segment.direction, vec3(1.0), 0.0, seed, 0, 0, true, false, AIR);
    waiting_count = 0u;
    for (uint i = 0u; i < MOST_FLIGHTS; i++) {
        bool is_eye = i == 0u;
        SceneHit hit;
        bool has_met = trace_cast(segment, begin, end, is_eye, flight.is_inside, false, hit);
        if (!is_eye)
            trace_see_lights(flight, has_met ? hit.t : ENDLESS);
        if (has_met || is_eye) {
            Vertex vertex;
            if (has_met) {
                vertex = trace_vertex_of(segment, hit, flight.medium);
            } else {
                // As the image has it.
                bool is_within = dot(outward, flight.direction) > 0.0;
                vec3 position = segment.start + t * segment.direction;
                float lift = error + trace_rounding(segment.start, position);
                vec3 normal = is_within ? -outward : outward;
                vertex = Vertex(position, normal, normal, lift, is_within, is_within, true, AIR, 0, light_material(0u));
                hit.t = t;
            }
            float way = is_eye ? hit.t + anchor_depth * ray.stretch : hit.t;
            if (is_eye)
                vertex.medium = vertex.is_within ? vertex.index : AIR;
            flight.light *= trace_absorbed(vertex.medium, way);
            trace_shade(vertex, flight, number);
        } else {
            trace_escape(flight);
        }
        if (waiting_count == 0u)
            break;
        flight = trace_pop();
        segment = segment_from(flight.origin, flight.direction);
        begin = 0.0;
        end = ENDLESS;
    }
}

// What is seen of the surface at a depth: premultiplied colour and alpha. `pixel` counts all pixels of the image.
vec4 trace_pixel(vec2 position, uint pixel, float depth, vec3 outward) {
    radiance = behind = vec3(0.0);
    Ray ray = ray_from_pixel(position);
    for (uint i = 0u; i < sample_count; i++)
        trace_sample(ray, depth, outward, random_mixed(pixel + 1u), first_sample + i);
    float mean = 1.0 / float(max(sample_count, 1u));
    return vec4(radiance * mean, 1.0 - (behind.x + behind.y + behind.z) * mean / 3.0);
}
