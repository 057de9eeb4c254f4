"""Benchmarks: what is measured, against what, on which machine."""
