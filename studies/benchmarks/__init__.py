"""Benchmarks beside other ways to compute the same: NumPy, scikit-learn, readable twins."""
