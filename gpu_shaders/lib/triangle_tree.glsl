// Rays against a tree over triangles, of the same form as the fitted BVH; in scene coordinates too.
#include "lib/fitted_bvh.glsl"

#if WITH_STORAGE
layout(std430, binding = 8) readonly buffer TriangleNodes {
    uvec4 triangle_nodes[];
};
layout(std430, binding = 9) readonly buffer Triangles {
    vec4 triangles[]; // six for each triangle of a leaf: its corners, of which the first has the material too, and their normals
};
#else
uniform usamplerBuffer triangle_nodes_tx;
uniform samplerBuffer triangles_tx;
#endif

// More than distances to planes are off by rounding, as a share: a ray must not slip through between two boxes.
const float BOX_MARGIN = 1e-6;

struct TriangleHit {
    float t;
    uint entry;
    vec3 normal; // unit, as the corners go round
    vec2 shares; // what the second and the third corner count there
};

uvec4 triangle_words(uint index) {
#if WITH_STORAGE
    return triangle_nodes[index];
#else
    return texelFetch(triangle_nodes_tx, int(index));
#endif
}

vec4 triangle_texel(uint entry, uint number) {
#if WITH_STORAGE
    return triangles[6u * entry + number];
#else
    return texelFetch(triangles_tx, int(6u * entry + number));
#endif
}

TreeNode triangle_node(uint index, Segment segment, float begin, float end) {
    TreeNode node = tree_node_of(triangle_words(2u * index), triangle_words(2u * index + 1u), segment, begin, end);
    node.exit += abs(node.exit) * BOX_MARGIN;
    return node;
}

// The ray goes along z (Woop, Benthin and Wald 2013).
vec3 triangle_turned(vec3 point, vec3 direction) {
    vec3 size = abs(direction);
    if (size.x >= size.y && size.x >= size.z)
        return point.yzx;
    return size.y >= size.z ? point.zxy : point.xyz;
}

// Neighbours compute the same of an edge that they share, but for the sign.
bool triangle_meets(vec3 a, vec3 b, vec3 c, vec3 direction) {
    vec3 along = triangle_turned(direction, direction);
    vec2 shear = along.xy / along.z;
    a = triangle_turned(a, direction);
    b = triangle_turned(b, direction);
    c = triangle_turned(c, direction);
    vec2 p = a.xy - shear * a.z, q = b.xy - shear * b.z, r = c.xy - shear * c.z;
    float u = r.x * q.y - r.y * q.x, v = p.x * r.y - p.y * r.x, w = q.x * p.y - q.y * p.x;
    float least = min(min(u, v), w), most = max(max(u, v), w);
    return (least >= 0.0 || most <= 0.0) && least < most;
}

// Where the segment meets a triangle between two distances.
bool triangle_crossing(Segment segment, uint entry, float begin, float end, inout TriangleHit hit) {
    vec3 a = triangle_texel(entry, 0u).xyz - segment.start, b = triangle_texel(entry, 1u).xyz - segment.start;
    vec3 c = triangle_texel(entry, 2u).xyz - segment.start;
    if (!triangle_meets(a, b, c, segment.direction))
        return false;
    vec3 right = b - a, up = c - a, normal = cross(right, up);
    float slope = dot(normal, segment.direction), t = dot(a, normal) / slope;
    if (!(t >= begin && t <= end))
        return false;
    // Cramer's rule (Moeller and Trumbore 1997).
    vec3 across = cross(segment.direction, a);
    hit = TriangleHit(t, entry, normalize(normal), vec2(-dot(across, up), dot(across, right)) / slope);
    return true;
}

// The first triangle that a segment meets between two distances from either side; any one where `takes_any`.
bool triangle_cast(Segment segment, float begin, float end, bool takes_any, out TriangleHit hit) {
    uint waiting[STACK_LENGTH];
    uint height = 0u, index = 0u;
    bool has_met = false;
    hit = TriangleHit(end, 0u, vec3(0.0), vec2(0.0));
    TreeNode node = triangle_node(0u, segment, begin, end);
    for (uint i = 0u; i < MOST_VISITS; i++) {
        if (node.enter <= node.exit && node.count == TREE_INNER) {
            uint left = index + 1u, right = node.link;
            TreeNode left_node = triangle_node(left, segment, begin, end), right_node = triangle_node(right, segment, begin, end);
            bool meets_left = left_node.enter <= left_node.exit, meets_right = right_node.enter <= right_node.exit;
            bool takes_right = !meets_left || (meets_right && right_node.enter < left_node.enter);
            if (meets_left && meets_right) {
                waiting[min(height, uint(STACK_LENGTH - 1))] = takes_right ? left : right;
                height++;
            }
            index = takes_right ? right : left;
            node = takes_right ? right_node : left_node;
            if (meets_left || meets_right)
                continue;
        } else if (node.enter <= node.exit) {
            for (uint j = 0u; j < min(node.count, MOST_ENTRIES); j++)
                if (triangle_crossing(segment, node.link + j, begin, end, hit)) {
                    has_met = true;
                    end = hit.t;
                }
            if (takes_any && has_met)
                return true;
        }
        if (height == 0u)
            break;
        height--;
        index = waiting[min(height, uint(STACK_LENGTH - 1))];
        node = triangle_node(index, segment, begin, end);
    }
    return has_met;
}
