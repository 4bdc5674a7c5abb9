"""The benchmarks: `make bench` and `make bench-peers`, described in docs/benchmarks.md."""
