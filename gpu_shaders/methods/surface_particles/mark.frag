// Stores the particle's number.

flat in uint v_number;
layout(location = 0) out uint out_number;

void main() {
    out_number = v_number;
}
