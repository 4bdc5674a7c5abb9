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
uniform float isovalue;

const uint TREE_INNER = 0xffffffffu; // counts that say what a node is
const uint TREE_FULL = 0xfffffffeu;

// The field is on the surface where it is as close to the isovalue, relatively: some roundings of a sum.
const float CLOSE = 1e-6;
// A stretch of a ray is halved where half its length is more so many radii of the smallest ball on it.
const float LONGEST = 2.0;
const float LEAST_BEND = 1e-30;
const float MOST_INVERSE = 1e18;
const float FAR = 3e38;

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

// A leaf of the tree as a stretch of a segment sees it.
struct Leaf {
    uint first;
    uint count;
    vec3 point; // the middle of the stretch
    vec3 direction;
};

// A ball on the stretch: x(t) = peak - ((t - middle) * inverse)^2, t counts from the middle of the stretch.
struct LeafBall {
    float peak;
    float middle;
    float inverse; // of R
    float weight;
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

LeafBall leaf_ball(Leaf leaf, uint entry) {
    vec4 sphere = leaf_sphere(entry);
    vec3 to_center = sphere.xyz - leaf.point;
    float inverse = 1.0 / sphere.w;
    float along = dot(to_center, leaf.direction);
    vec3 apart = (to_center - along * leaf.direction) * inverse;
    return LeafBall(1.0 - dot(apart, apart), along, inverse, leaf_weight(entry));
}

// The balls that the stretch meets, as long as there is room for all of them; vectors, because indexed structures take four times
// the memory on some processors.
vec4 met[MET_LENGTH];
uint met_count;

// What bounds the field on the stretch.
struct LeafBounds {
    float most;     // the field is not greater
    float bend;     // nor its second derivative towards the isovalue
    float sharpest; // 1 / R of the smallest ball
};

LeafBounds leaf_gather(Leaf leaf, float reach, bool is_inside) {
    LeafBounds bounds = LeafBounds(0.0, LEAST_BEND, 0.0);
    met_count = 0u;
    for (uint i = 0u; i < min(leaf.count, MOST_ENTRIES); i++) {
        LeafBall ball = leaf_ball(leaf, leaf.first + i);
        float offset = (clamp(ball.middle, -reach, reach) - ball.middle) * ball.inverse;
        float nearest = ball.peak - offset * offset;
        if (nearest <= 0.0)
            continue;
        bool rises = (ball.weight > 0.0) != is_inside;
        float bend = rises ? kernel_steepest_rise(ball.peak) : kernel_steepest_fall(ball.peak);
        bounds.most += max(ball.weight, 0.0) * kernel_value(nearest);
        bounds.bend += abs(ball.weight) * bend * ball.inverse * ball.inverse;
        bounds.sharpest = max(bounds.sharpest, ball.inverse);
        if (met_count < uint(MET_LENGTH))
            met[met_count] = vec4(ball.peak, ball.middle, ball.inverse, ball.weight);
        met_count++;
    }
    return bounds;
}

// The field and its slope at a distance, and where the slope jumps next.
struct LeafValue {
    float field;
    float slope;
    float next_kink;
};

void leaf_add(inout LeafValue value, LeafBall ball, float at) {
    float offset = (at - ball.middle) * ball.inverse;
    float x = ball.peak - offset * offset;
#if KERNEL_POWER == 1
    float half_chord = sqrt(max(ball.peak, 0.0)) / ball.inverse;
    float to_entry = ball.middle - half_chord - at, to_exit = ball.middle + half_chord - at;
    if (to_entry > 0.0)
        value.next_kink = min(value.next_kink, at + to_entry);
    if (to_exit > 0.0)
        value.next_kink = min(value.next_kink, at + to_exit);
    if (ball.peak <= 0.0 || to_entry > 0.0 || to_exit <= 0.0)
        return;
    x = max(x, 1e-30);
#else
    if (x <= 0.0)
        return;
#endif
    value.field += ball.weight * kernel_value(x);
    value.slope -= 2.0 * ball.weight * kernel_derivative(x) * offset * ball.inverse;
}

LeafValue leaf_value(Leaf leaf, float at) {
    LeafValue value = LeafValue(0.0, 0.0, FAR);
    if (met_count <= uint(MET_LENGTH)) {
        for (uint i = 0u; i < min(met_count, uint(MET_LENGTH)); i++)
            leaf_add(value, LeafBall(met[i].x, met[i].y, met[i].z, met[i].w), at);
    } else {
        for (uint i = 0u; i < min(leaf.count, MOST_ENTRIES); i++)
            leaf_add(value, leaf_ball(leaf, leaf.first + i), at);
    }
    return value;
}

// Where the field first crosses the isovalue within `reach` of the middle of the stretch: with g the distance to the isovalue, s
// the slope towards it and M a bound of the second derivative, not before 2 g / (s + sqrt(s^2 + 2 M g)).
bool leaf_walk(Leaf leaf, float reach, float bend, bool is_inside, out float at) {
    float side = is_inside ? -1.0 : 1.0;
    at = -reach;
    for (uint i = 0u; i < MOST_STEPS; i++) {
        LeafValue value = leaf_value(leaf, at);
        float gap = side * (isovalue - value.field), slope = side * value.slope;
        if (gap <= 0.0)
            return true;
        float root = sqrt(slope * slope + 2.0 * bend * gap);
        float step = slope > 0.0 ? 2.0 * gap / (slope + root) : (root - slope) / bend;
        float next = min(at + step, max(value.next_kink, at + max(abs(at) * 1.2e-7, 1e-37)));
        if (next > reach)
            return false;
        bool is_there = gap <= CLOSE * isovalue || next == at;
        at = next;
        if (is_there)
            return true;
    }
    return false;
}

// Whether the field is above the isovalue where the projections of the centres onto the ray are on average, each weighted by what it
// adds there: if the ray meets the fluid, then most likely in this place (section 3).
bool leaf_is_fluid_at_projections(Leaf leaf, float reach) {
    float moments = 0.0, shares = 0.0;
    for (uint i = 0u; i < min(met_count, uint(MET_LENGTH)); i++) {
        float share = met[i].w * kernel_value(met[i].x);
        moments += share * met[i].y;
        shares += share;
    }
    return shares > 0.0 && leaf_value(leaf, clamp(moments / shares, -reach, reach)).field >= isovalue;
}

// Where a segment crosses the surface between two distances, any crossing where `takes_any`.
bool leaf_crossing(Segment segment, TreeNode node, bool is_inside, bool takes_any, out float t) {
    t = node.enter;
    float begin = node.enter, longest = node.exit - node.enter;
    for (uint i = 0u; i < MOST_STEPS; i++) {
        float end = begin + longest < node.exit ? begin + longest : node.exit;
        float middle = 0.5 * (begin + end), reach = 0.5 * (end - begin), at;
        Leaf leaf = Leaf(node.link, node.count, segment.start + middle * segment.direction, segment.direction);
        LeafBounds bounds = leaf_gather(leaf, reach, is_inside);
        if (is_inside || bounds.most >= isovalue * (1.0 - CLOSE)) {
            if (reach * bounds.sharpest > LONGEST) {
                longest *= 0.5;
                continue;
            }
            if (takes_any && !is_inside && leaf_is_fluid_at_projections(leaf, reach)) {
                t = middle;
                return true;
            }
            if (leaf_walk(leaf, reach, bounds.bend, is_inside, at)) {
                t = clamp(middle + at, begin, end);
                return true;
            }
        }
        if (end == node.exit)
            return false;
        begin = end;
        longest *= 2.0;
    }
    return false;
}

bool leaf_contains(TreeNode node, vec3 point) {
    float field = 0.0;
    for (uint i = 0u; i < min(node.count, MOST_ENTRIES); i++) {
        vec4 sphere = leaf_sphere(node.link + i);
        vec3 apart = (point - sphere.xyz) / sphere.w;
        field += leaf_weight(node.link + i) * kernel_value(1.0 - dot(apart, apart));
    }
    return field >= isovalue;
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
                hit.is_inside = node.count == TREE_FULL || leaf_contains(node, segment.start + begin * segment.direction);
                restarts = true;
            } else if (node.count == TREE_FULL) {
                if (takes_any && !hit.is_inside)
                    return true;
            } else if (leaf_crossing(segment, node, hit.is_inside, takes_any, crossing)) {
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
