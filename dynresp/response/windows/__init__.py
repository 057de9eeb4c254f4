"""Windows: short pieces of motion, and how unlike two of them are (the window error)."""
