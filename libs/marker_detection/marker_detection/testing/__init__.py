"""Rendered images of markers with known truth, for tests and benchmarks."""
