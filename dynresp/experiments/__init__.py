"""Experiments: read from a file, run, and reported."""
