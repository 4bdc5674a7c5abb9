// What a ray knows between two rounds: the last sample, and where the next one may be.

const int GOING = 0;
const int FOUND = 1;   // there is a bracket
const int MISSED = 2;  // no ball lets the density rise any more
const int GAVE_UP = 3; // too many samples

struct March {
    float t;     // of the last sample, or the start
    float value; // there: the density less the threshold, turned so that it rises through 0 at the surface
    float asked; // the least distance of the next sample
    int status;
    int used; // samples
};

March march_unpack(vec4 texel) {
    int code = int(texel.w);
    return March(texel.x, texel.y, texel.z, code & 3, code >> 2);
}

vec4 march_pack(March march) {
    return vec4(march.t, march.value, march.asked, float(march.used << 2 | march.status));
}

// What a depth buffer holds of it: at rays that have stopped all balls fail the test.
float march_depth(March march) {
    return march.status == GOING ? 1.0 : 0.0;
}
