// Repulsion and the way back to the surface move a particle at most so far in a step, in reaches and in influence radii: explicit
// steps stay stable so.
const float MOTION_LONGEST = 0.25;

// A motion that is not too long for a length.
vec3 motion_within(vec3 motion, float span) {
    float longest = MOTION_LONGEST * span, squared = dot(motion, motion);
    return squared > longest * longest ? motion * (longest / sqrt(squared)) : motion;
}
