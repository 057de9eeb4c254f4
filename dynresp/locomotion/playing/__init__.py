"""Walks through a graph as motion: blended, resampled, the feet fitted."""
