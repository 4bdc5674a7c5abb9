// The rectangle around a group of balls at their nearest distance; see groups.py.

in vec3 in_corner; // normalised device coordinates

void main() {
    gl_Position = vec4(in_corner, 1.0);
}
