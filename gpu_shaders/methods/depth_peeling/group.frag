// Only counted, never kept.

void main() {
}
