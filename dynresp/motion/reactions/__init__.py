"""The reaction library: named ranges of motion that a hit person can go on with."""
