// What a ray knows between two rounds: the last sample, and where the next one may be.

const int GOING = 0;
const int FOUND = 1;   // there is a bracket
const int MISSED = 2;  // no ball lets the density rise any more
const int GAVE_UP = 3; // too many samples
const int LOOKING = 4; // for a peak between samples, see Past

struct March {
    float t;     // of the last sample, or the start
    float value; // there: the density less the threshold, turned so that it rises through 0 at the surface
    float asked; // the least distance of the next sample
    int status;
    int used; // samples
};

March march_unpack(vec4 texel) {
    int code = int(texel.w);
    return March(texel.x, texel.y, texel.z, code & 7, code >> 3);
}

vec4 march_pack(March march) {
    return vec4(march.t, march.value, march.asked, float(march.used << 3 | march.status));
}

// What a depth buffer holds of it: at rays that do not go on all balls fail the test, at others those that begin behind a kernel
// sphere, which the ray cannot pass unseen but where it grazes it. `barrier`: see targets.py.
float march_depth(March march, vec2 side, float barrier, float depth_scale) {
    bool is_barred = side.x > 0.0 && march.asked * depth_scale < barrier;
    return march.status != GOING ? 0.0 : is_barred ? barrier : 1.0;
}

// Until there is a bracket, its place tells of the sample before the last one; and where the ray looks for a peak.
struct Past {
    float t;
    float value;
    float aside; // of the peak: half of the distance between two looks
    float peak;
};

const float NO_PAST = 1e30; // a value from which nothing rises

Past past_unpack(vec4 texel) {
    return Past(texel.x, texel.z, -texel.y, texel.w);
}

// As a bracket that is not there: its second number is below 0.
vec4 past_pack(Past past) {
    return vec4(past.t, -past.aside, past.value, past.peak);
}
