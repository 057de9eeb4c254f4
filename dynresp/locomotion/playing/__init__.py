"""Walks as motion: blended, brought to a frame rate, the feet fitted."""
