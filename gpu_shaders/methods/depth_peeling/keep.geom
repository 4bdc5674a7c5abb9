// Passes on the pairs that are kept.

layout(points) in;
layout(points, max_vertices = 1) out;

flat in uvec2 v_pair[1];
flat in int v_is_kept[1];

flat out uvec2 out_pair;

void main() {
    if (v_is_kept[0] != 0) {
        out_pair = v_pair[0];
        EmitVertex();
        EndPrimitive();
    }
}
