// Rays against the fitted BVH (Gourmel et al. 2010, section 5.2); docs/fitted_bvh.md describes the tree and derives the steps.
// All is in scene coordinates: world space less the tree's origin.
// WITH_STORAGE: storage buffers (OpenGL 4.3), else buffer textures. WITH_WEIGHTS: whether the balls' weights differ. OVERLAPS:
// whether nodes do, so that the first hit found need not be the nearest. STACK_LENGTH: not less than the inner nodes above a leaf.
#include "lib/kernel.glsl"

#if WITH_STORAGE
layout(std430, binding = 0) readonly buffer TreeNodes {
    uvec4 tree_nodes[]; // two a node
};
layout(std430, binding = 1) readonly buffer LeafBalls {
    vec4 leaf_balls[]; // centre, influence radius R
};
#if WITH_WEIGHTS
layout(std430, binding = 2) readonly buffer LeafWeights {
    float leaf_weights[];
};
#endif
#else
// Words, because some processors flush small integers that they take for floats.
uniform usamplerBuffer nodes_tx;
uniform samplerBuffer balls_tx;
#if WITH_WEIGHTS
uniform samplerBuffer weights_tx;
#endif
#endif

#if !WITH_WEIGHTS
uniform float weight_of_all;
#endif

const uint TREE_INNER = 0xffffffffu; // counts that say what a node is
const uint TREE_FULL = 0xfffffffeu;

const float MOST_INVERSE = 1e18;
struct Segment {
    vec3 start;
    vec3 direction; // unit
    vec3 inverse;
};

struct TreeNode {
    float enter; // where the segment enters the box, and where it leaves it
    float exit;
    uint link;
    uint count;
};

struct TreeHit {
    float t;
    uint first; // the balls of the leaf
    uint count;
    bool is_inside; // the segment leaves the fluid there
};

uvec4 tree_words(uint index) {
#if WITH_STORAGE
    return tree_nodes[index];
#else
    return texelFetch(nodes_tx, int(index));
#endif
}

vec4 leaf_sphere(uint entry) {
#if WITH_STORAGE
    return leaf_balls[entry];
#else
    return texelFetch(balls_tx, int(entry));
#endif
}

float leaf_weight(uint entry) {
#if !WITH_WEIGHTS
    return weight_of_all;
#elif WITH_STORAGE
    return leaf_weights[entry];
#else
    return texelFetch(weights_tx, int(entry)).x;
#endif
}

#include "lib/leaf.glsl"

Segment segment_from(vec3 start, vec3 direction) {
    vec3 sides = mix(vec3(1.0), vec3(-1.0), lessThan(direction, vec3(0.0)));
    return Segment(start, direction, sides / max(abs(direction), 1.0 / MOST_INVERSE));
}

// Rounding keeps the order of planes: the intervals of nested boxes are nested, and those of neighbours share their border.
TreeNode tree_node_of(uvec4 low, uvec4 high, Segment segment, float begin, float end) {
    vec3 a = (uintBitsToFloat(low.xyz) - segment.start) * segment.inverse;
    vec3 b = (uintBitsToFloat(high.xyz) - segment.start) * segment.inverse;
    vec3 enter = min(a, b), exit = max(a, b);
    return TreeNode(max(max(enter.x, enter.y), max(enter.z, begin)), min(min(exit.x, exit.y), min(exit.z, end)), low.w, high.w);
}

TreeNode tree_node(uint index, Segment segment, float begin, float end) {
    return tree_node_of(tree_words(2u * index), tree_words(2u * index + 1u), segment, begin, end);
}

// The box of an empty leaf is reversed, and would be everywhere.
bool tree_meets(TreeNode node) {
    return node.enter <= node.exit && node.count != 0u;
}

// Where a segment first crosses the surface between `begin` and `end`, either way; any crossing where `takes_any`. Whether it is
// inside the fluid at `begin` is asked first where `asks`, else it is `is_inside`.
bool tree_cast(Segment segment, float begin, float end, bool asks, bool is_inside, bool takes_any, out TreeHit hit) {
    uint waiting[STACK_LENGTH];
    uint height = 0u, index = 0u;
    hit = TreeHit(end, 0u, 0u, is_inside);
    bool has_found = false;
    float crossing = end;
    // The boxes that hold the beginning are those that the segment meets there.
    TreeNode node = tree_node(0u, segment, begin, asks ? begin : end);
    for (uint i = 0u; i < MOST_VISITS; i++) {
        bool restarts = false;
        if (tree_meets(node)) {
            if (node.count == TREE_INNER) {
                float limit = asks ? begin : end;
                uint left = index + 1u, right = node.link;
                TreeNode left_node = tree_node(left, segment, begin, limit), right_node = tree_node(right, segment, begin, limit);
                bool meets_left = tree_meets(left_node), meets_right = tree_meets(right_node);
                bool takes_right = !meets_left || (meets_right && right_node.enter < left_node.enter);
                if (meets_left && meets_right) {
                    waiting[min(height, uint(STACK_LENGTH - 1))] = takes_right ? left : right;
                    height++;
                }
                index = takes_right ? right : left;
                node = takes_right ? right_node : left_node;
                if (meets_left || meets_right)
                    continue;
            } else if (asks) {
                hit.is_inside = node.count == TREE_FULL || leaf_contains(node.link, node.count, segment.start + begin * segment.direction);
                restarts = true;
            } else if (node.count == TREE_FULL) {
                if (takes_any && !hit.is_inside)
                    return true;
            } else if (leaf_crossing(LeafStretch(segment.start, segment.direction, node.enter, node.exit), node.link, node.count, hit.is_inside, takes_any, crossing)) {
                hit = TreeHit(crossing, node.link, node.count, hit.is_inside);
                has_found = true;
#if OVERLAPS
                end = crossing;
                if (takes_any)
                    return true;
#else
                return true;
#endif
            }
        }
        if (asks && (restarts || height == 0u)) {
            asks = false;
            height = 0u;
            index = 0u;
        } else if (height == 0u) {
            break;
        } else {
            height--;
            index = waiting[min(height, uint(STACK_LENGTH - 1))];
        }
        node = tree_node(index, segment, begin, asks ? begin : end);
    }
    return has_found;
}
