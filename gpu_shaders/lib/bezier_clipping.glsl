// The first root of a polynomial in Bernstein form on [0, 1] by Bezier clipping (Nishita, Sederberg, Kakimoto 1990;
// Kanamori et al. 2008, sections 3.2 and 5.4): sign changes first, split where there are several, clip where there is one.
// Only the first root is wanted, so what waits is always the rest of [0, 1]: it is cut anew from the given polynomial
// and needs no stack.

const float BEZIER_NO_ROOT = 2.0;
// Below this width a root is located; one secant step follows, which squares the error.
const float BEZIER_WIDTH = 1e-4;
// Each halving or clipping at least halves a segment; 20 halvings reach the resolution of a float, for several segments.
const int BEZIER_STEPS = 96;

// De Casteljau's algorithm in place. The loops count up: Mesa 22 unrolls such loops wrongly where they count down.
void bezier_keep_right(inout float p[KERNEL_DEGREE + 1], float u) {
    for (int step = 1; step <= KERNEL_DEGREE; step++)
        for (int j = 0; j <= KERNEL_DEGREE - step; j++)
            p[j] = mix(p[j], p[j + 1], u);
}

void bezier_keep_left(inout float p[KERNEL_DEGREE + 1], float u) {
    for (int step = 1; step <= KERNEL_DEGREE; step++)
        for (int j = 0; j <= KERNEL_DEGREE - step; j++)
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

// The least u in [0, 1] with p(u) >= 0, or BEZIER_NO_ROOT.
float bezier_first_root(float p[KERNEL_DEGREE + 1]) {
    float segment[KERNEL_DEGREE + 1] = p;
    float low = 0.0, high = 1.0;
    // The root that is looked for is not behind `limit`; `bracketed`: it is known to be before it.
    float limit = 1.0;
    bool bracketed = false;
    for (int step = 0; step < BEZIER_STEPS; step++) {
        if (segment[0] >= 0.0)
            return low;
        int changes = bezier_sign_changes(segment);
        if (changes == 0) {
            if (high >= limit)
                return bracketed ? limit : BEZIER_NO_ROOT;
            low = high;
            high = limit;
            segment = p;
            bezier_restrict(segment, low, high);
            continue;
        }
        float width = high - low;
        if (width <= BEZIER_WIDTH) {
            // The chord's root; a segment this narrow is straight, or touches the axis.
            float rise = segment[KERNEL_DEGREE] - segment[0];
            return low + width * (rise > 0.0 ? clamp(-segment[0] / rise, 0.0, 1.0) : 0.5);
        }
        vec2 kept = vec2(0.0, 0.5);
        if (changes == 1) {
            limit = high;
            bracketed = true;
            vec2 hull = bezier_hull_crossing(segment);
            // Rounding may leave the hull of an almost straight segment no width at all.
            hull = vec2(max(hull.x - 1e-6, 0.0), min(hull.y + 1e-6, 1.0));
            // A clip that takes little off costs more than a halving.
            kept = hull.y - hull.x < 0.5 ? hull : kept;
        }
        bezier_restrict(segment, kept.x, kept.y);
        high = low + width * kept.y;
        low += width * kept.x;
    }
    return low;
}
