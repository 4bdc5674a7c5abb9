// What a shaded sample depends on beside its textures; ShadeParams in presenter.py fills it in this order.
struct ShadeParams {
    mat4 world_from_view;
    // Left, bottom, right, top of the image, at distance 1 from the eye.
    vec4 window;
    // Towards the light, view space; its strength.
    vec4 light;
    // Absorption by Blender unit, index of refraction, metallic; strength of the depth contrast.
    vec4 optics;
    // Linear Rec.709; 1 where the balls have colours of their own, else 0.
    vec4 base;
    // Depths, speeds: the least and the greatest.
    vec4 ranges;
    // Ambient, roughness, number of the style, 1 for perspective and 0 for orthographic.
    vec4 surface;
    // Factor of exposure, exponent of gamma, size of the table (0: none), 1 where there is thickness.
    vec4 display;
};
