// A bracket: two distances between which a ray meets the surface, and there the density less the threshold, turned so that it
// rises: below 0 before, at least 0 behind. NO_BRACKET for none.

struct Bracket {
    float before;
    float behind;
    float value_before;
    float value_behind;
};

const vec4 NO_BRACKET = vec4(-1.0);

Bracket bracket_unpack(vec4 texel) {
    return Bracket(texel.x, texel.y, texel.z, texel.w);
}

vec4 bracket_pack(Bracket bracket) {
    return vec4(bracket.before, bracket.behind, bracket.value_before, bracket.value_behind);
}

bool bracket_is_there(Bracket bracket) {
    return bracket.behind >= 0.0;
}

// Where the straight line between the ends meets 0 (Mishima et al. 2008, equation 5).
float bracket_secant(Bracket bracket) {
    float share = -bracket.value_before / max(bracket.value_behind - bracket.value_before, 1e-30);
    return bracket.before + clamp(share, 0.0, 1.0) * (bracket.behind - bracket.before);
}

// A sample narrows the bracket from the side that it lies on; of several roots the first that is known stays.
Bracket bracket_narrow(Bracket bracket, vec4 samples, vec4 values) {
    for (int i = 0; i < 4; i++) {
        if (values[i] >= 0.0 && samples[i] >= bracket.before && samples[i] < bracket.behind) {
            bracket.behind = samples[i];
            bracket.value_behind = values[i];
        }
    }
    for (int i = 0; i < 4; i++) {
        if (values[i] < 0.0 && samples[i] > bracket.before && samples[i] < bracket.behind) {
            bracket.before = samples[i];
            bracket.value_before = values[i];
        }
    }
    return bracket;
}
