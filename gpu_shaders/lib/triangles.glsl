// Squares as two triangles.

// The corners of the triangles 0 1 2 and 2 1 3, in the unit square.
vec2 square_corner(int vertex) {
    int corner = vertex < 3 ? vertex : vertex == 3 ? 2 : vertex == 4 ? 1 : 3;
    return vec2(corner & 1, corner >> 1);
}
