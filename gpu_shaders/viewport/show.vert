void main() {
    place = corner * 0.5 + 0.5;
    gl_Position = vec4(mix(params.rectangle.xy, params.rectangle.zw, place), 0.0, 1.0);
}
