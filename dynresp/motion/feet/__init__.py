"""Feet: where they stand, how far they slide, and fitting them so that they do not."""
