"""The classifier: features of a hit, its file, and its compiled prediction."""
