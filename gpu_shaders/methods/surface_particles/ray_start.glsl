// Whether rays start inside the fluid.

#if WITH_STARTS
uniform sampler2D inside_tx; // 1 where a ray starts inside

bool starts_inside(ivec2 pixel) {
    return texelFetch(inside_tx, pixel, 0).x > 0.5;
}
#else
bool starts_inside(ivec2 pixel) {
    return false;
}
#endif
