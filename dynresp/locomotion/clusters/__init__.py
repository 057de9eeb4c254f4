"""The higher layer: groups of frames, and what can be reached from each."""
