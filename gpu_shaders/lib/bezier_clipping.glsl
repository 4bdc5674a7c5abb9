// The first root of a polynomial in Bernstein form on [0, 1] by Bezier clipping (Nishita, Sederberg, Kakimoto 1990;
// Kanamori et al. 2008, sections 3.2 and 5.4): sign changes first, split where there are several, clip where there is one.
// The right halves of splits wait on a stack of BEZIER_STACK segments. Only the first root is wanted, so where the stack is
// full its lowest segment, which is the last on the axis, can be given up: the rest of [0, 1] is cut anew from the given
// polynomial when all before it is done.

const float BEZIER_NO_ROOT = 2.0;
// Below this width a root is located; the step that follows cubes the error.
const float BEZIER_WIDTH = 1e-3;
// Each step at least halves a segment; 20 halvings reach the resolution of a float, for several segments.
const int BEZIER_STEPS = 96;

#if DIAGNOSTICS
// Polynomials with a sign change, splits and clips for all of them, and the most for one.
uvec3 bezier_effort = uvec3(0u);

void bezier_note(int steps) {
    if (steps > 0)
        bezier_effort = uvec3(bezier_effort.xy + uvec2(1u, uint(steps)), max(bezier_effort.z, uint(steps)));
}
#endif

// De Casteljau's algorithm in place. The loops count up: Mesa 22 unrolls such loops wrongly where they count down.
void bezier_keep_right(inout float p[KERNEL_DEGREE + 1], float u) {
    for (int level = 1; level <= KERNEL_DEGREE; level++)
        for (int j = 0; j <= KERNEL_DEGREE - level; j++)
            p[j] = mix(p[j], p[j + 1], u);
}

void bezier_keep_left(inout float p[KERNEL_DEGREE + 1], float u) {
    for (int level = 1; level <= KERNEL_DEGREE; level++)
        for (int j = 0; j <= KERNEL_DEGREE - level; j++)
            p[KERNEL_DEGREE - j] = mix(p[KERNEL_DEGREE - j - 1], p[KERNEL_DEGREE - j], u);
}

// The polynomial on [low, high].
void bezier_restrict(inout float p[KERNEL_DEGREE + 1], float low, float high) {
    bezier_keep_left(p, high);
    bezier_keep_right(p, low / high);
}

int bezier_sign_changes(float p[KERNEL_DEGREE + 1]) {
    int changes = 0;
    for (int i = 0; i < KERNEL_DEGREE; i++)
        changes += int((p[i] >= 0.0) != (p[i + 1] >= 0.0));
    return changes;
}

// Where the convex hull of the control points meets the axis, for coefficients that change sign once, from - to +.
// The hull's edges are among the lines between a point below and a point above.
vec2 bezier_hull_crossing(float p[KERNEL_DEGREE + 1]) {
    vec2 crossing = vec2(1.0, 0.0);
    for (int i = 0; i < KERNEL_DEGREE; i++) {
        for (int j = i + 1; j <= KERNEL_DEGREE; j++) {
            if (p[i] < 0.0 && p[j] >= 0.0) {
                float u = (float(i) + float(j - i) * p[i] / (p[i] - p[j])) / float(KERNEL_DEGREE);
                crossing = vec2(min(crossing.x, u), max(crossing.y, u));
            }
        }
    }
    return clamp(crossing, 0.0, 1.0);
}

// Halves a segment: `p` becomes the left half.
void bezier_split(inout float p[KERNEL_DEGREE + 1], out float right[KERNEL_DEGREE + 1]) {
    right = p;
    for (int level = 1; level <= KERNEL_DEGREE; level++) {
        for (int j = 0; j <= KERNEL_DEGREE - level; j++)
            right[j] = 0.5 * (right[j] + right[j + 1]);
        p[level] = right[0];
    }
}

// The root of a narrow segment, as a share of it: that of the parabola with the same ends and the same slope at the first.
// A segment that only touches the axis has it anywhere.
float bezier_parabola_root(float p[KERNEL_DEGREE + 1]) {
    float slope = float(KERNEL_DEGREE) * (p[1] - p[0]);
    float bend = p[KERNEL_DEGREE] - p[0] - slope;
    float divisor = slope + sqrt(max(slope * slope - 4.0 * bend * p[0], 0.0));
    return divisor > 0.0 ? clamp(-2.0 * p[0] / divisor, 0.0, 1.0) : 0.5;
}

// Narrows a segment with one sign change, hence one root, to the part that has it: what the convex hull leaves, or where that
// is more than half, a half. As shares of the segment.
vec2 bezier_narrow(inout float p[KERNEL_DEGREE + 1]) {
    vec2 hull = bezier_hull_crossing(p);
    // Rounding may leave the hull of an almost straight segment no width at all.
    hull = vec2(max(hull.x - 1e-6, 0.0), min(hull.y + 1e-6, 1.0));
    if (hull.y - hull.x < 0.5) {
        bezier_restrict(p, hull.x, hull.y);
        return hull;
    }
    float right[KERNEL_DEGREE + 1];
    bezier_split(p, right);
    if (right[0] >= 0.0)
        return vec2(0.0, 0.5);
    p = right;
    return vec2(0.5, 1.0);
}

#if BEZIER_STACK > 0
// The right halves that wait, in a ring: the lowest of a full stack is overwritten.
float bezier_stack[BEZIER_STACK * (KERNEL_DEGREE + 1)];
float bezier_stack_end[BEZIER_STACK];

void bezier_push(int slot, float p[KERNEL_DEGREE + 1], float end) {
    for (int i = 0; i <= KERNEL_DEGREE; i++)
        bezier_stack[slot * (KERNEL_DEGREE + 1) + i] = p[i];
    bezier_stack_end[slot] = end;
}

float bezier_pop(int slot, out float p[KERNEL_DEGREE + 1]) {
    for (int i = 0; i <= KERNEL_DEGREE; i++)
        p[i] = bezier_stack[slot * (KERNEL_DEGREE + 1) + i];
    return bezier_stack_end[slot];
}
#endif

// The least u in [0, 1] with p(u) >= 0, or BEZIER_NO_ROOT.
float bezier_first_root(float p[KERNEL_DEGREE + 1]) {
    float segment[KERNEL_DEGREE + 1] = p;
    float low = 0.0, high = 1.0;
    bool has_root = false; // a segment with one sign change was met
    int pushed = 0, waiting = 0;
    int steps = 0;
    for (int iteration = 0; iteration < BEZIER_STEPS; iteration++) {
        steps = iteration;
        if (segment[0] >= 0.0)
            break;
        int changes = bezier_sign_changes(segment);
        if (changes == 0) {
            // Rounding can lose a root at the end of its segment.
            if (has_root || high >= 1.0) {
                low = has_root ? high : BEZIER_NO_ROOT;
                break;
            }
            low = high;
#if BEZIER_STACK > 0
            if (waiting > 0) {
                waiting--;
                pushed--;
                high = bezier_pop(pushed % BEZIER_STACK, segment);
                continue;
            }
#endif
            high = 1.0;
            segment = p;
            bezier_restrict(segment, low, high);
            continue;
        }
        float width = high - low;
        if (width <= BEZIER_WIDTH) {
            low += width * bezier_parabola_root(segment);
            break;
        }
        vec2 kept = vec2(0.0, 0.5);
        if (changes == 1) {
            has_root = true;
            kept = bezier_narrow(segment);
        } else {
            float right[KERNEL_DEGREE + 1];
            bezier_split(segment, right);
#if BEZIER_STACK > 0
            bezier_push(pushed % BEZIER_STACK, right, high);
            pushed++;
            waiting = min(waiting + 1, BEZIER_STACK);
#endif
        }
        high = low + width * kept.y;
        low += width * kept.x;
    }
#if DIAGNOSTICS
    bezier_note(steps);
#endif
    return low;
}
