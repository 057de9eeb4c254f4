"""Time alignment: the exit from physics and the entry into the reaction."""
