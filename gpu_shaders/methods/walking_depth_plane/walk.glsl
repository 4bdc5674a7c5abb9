// What a pixel knows between two passes.
#include "lib/sampling/bracket.glsl"

uniform float step_share;    // the longest step by the radius of the smallest ball
uniform float tolerance;     // of the density, as a share of the threshold
uniform float threshold;
uniform float smallest_ball; // Blender units, see ball_paces in method.py

const float NOTHING = 1e30;
// A step of less than this share of the distance is none.
const float RESOLUTION = 4e-7;

struct Walk {
    float t;       // the last place that is known to lie before the surface
    float value;   // the density there less the threshold, turned so that it is below 0; see start.frag
    float first;   // where the four samples ahead begin; below 0: it does not walk
    float spacing; // from one of them to the next
    float pace;    // the least of ball_pace over the balls about it
    bool looks_far; // no ball reaches t: how far is the next one?
};

const float HAS_STOPPED = -1.0;

// So many steps beyond the last sample all balls are known that begin there, without looking far.
const float VIEW = 8.0;

// How far balls are asked for.
float walk_horizon(Walk walk, float last_sample) {
    if (walk.first < 0.0)
        return last_sample; // the bracket is narrowed
    return walk.looks_far ? NOTHING : last_sample + VIEW * walk.spacing;
}

Walk walk_unpack(vec4 place, vec2 pace) {
    return Walk(place.x, place.y, place.z, place.w, pace.x, pace.y > 0.0);
}

vec4 walk_pack_place(Walk walk) {
    return vec4(walk.t, walk.value, walk.first, walk.spacing);
}

vec2 walk_pack_pace(Walk walk) {
    return vec2(walk.pace, float(walk.looks_far));
}

bool walk_goes_on(Walk walk) {
    return walk.first >= 0.0;
}

// The density as the oracle sees it, 1 at the surface: 0 too where negative weights take it below, or a ray that started inside is
// deep in the fluid.
float oracle_density(float value) {
    return max(1.0 + value / threshold, 0.0);
}

// The shortest step, by the radius of the smallest ball: where the density rises above the threshold and falls again within it, it
// rises by a share of about the tolerance, since it changes with the square of such a way.
float shortest_share() {
    return min(sqrt(tolerance), step_share);
}

// The step into the view where the density is below the threshold (Mueller et al. 2007, section 3.2.3); the oracle alone would
// hardly come past a place where it all but touches.
float oracle_forward(float value, float pace) {
    float density = oracle_density(value);
    return pace * max(step_share * (1.0 - density * density), shortest_share());
}

// The step back where the density is above it.
float oracle_back(float value, float pace) {
    return 0.5 * step_share * pace * (oracle_density(value) - 1.0);
}

// Goes on from t by samples as far apart as the oracle's step there.
Walk walk_on(Walk walk) {
    walk.spacing = max(oracle_forward(walk.value, walk.pace), RESOLUTION * walk.t);
    walk.first = walk.t + walk.spacing;
    return walk;
}

// Goes on where a ball begins that is too small for the step that was taken.
Walk walk_on_behind(Walk walk, float begin) {
    walk.looks_far = false;
    walk = walk_on(walk);
    walk.first = max(begin, walk.t + RESOLUTION * walk.t);
    return walk;
}

// Goes on where no ball reaches t and the next one begins, of which only that is known.
Walk walk_leap(Walk walk, float begin) {
    walk.t = begin;
    walk.value = -threshold;
    walk.pace = smallest_ball;
    return walk_on_behind(walk, begin);
}

bool walk_has_arrived(Bracket bracket, float pace) {
    float width = bracket.behind - bracket.before;
    bool is_near = min(-bracket.value_before, bracket.value_behind) <= tolerance * threshold;
    return is_near && width <= shortest_share() * pace || width <= RESOLUTION * bracket.behind;
}
