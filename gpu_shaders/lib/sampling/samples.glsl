// Samples: four distances along the ray of each pixel, at which densities are asked for in one pass (Mishima et al. 2008, section
// 4.2). A pixel that asks for none has NO_SAMPLE in the first.

uniform float depth_scale; // a power of two that brings distances below 1/2, so that they fit a depth buffer

const float NO_SAMPLE = -1.0;
const vec4 NO_SAMPLES = vec4(NO_SAMPLE);

bool samples_asked(vec4 samples) {
    return samples.x >= 0.0;
}

float samples_nearest(vec4 samples) {
    return min(min(samples.x, samples.y), min(samples.z, samples.w));
}

float samples_farthest(vec4 samples) {
    return max(max(samples.x, samples.y), max(samples.z, samples.w));
}

// What a depth buffer holds of them: balls that begin beyond fail its test, at pixels that ask for nothing all balls do.
float samples_depth(vec4 samples) {
    return samples_asked(samples) ? samples_farthest(samples) * depth_scale : 0.0;
}
