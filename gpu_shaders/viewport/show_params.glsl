// How shaded samples come to the screen; ShowParams in presenter.py fills it in this order.
struct ShowParams {
    // Left, bottom, right, top in normalized device coordinates.
    vec4 rectangle;
    // Rows of the projection, for (-depth, 1): z in x and y, w in z and w.
    vec4 projection;
    // One by the number of samples; unused.
    vec4 samples;
};
