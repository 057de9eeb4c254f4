"""The lower layer: recorded frames, the ways between them, and walks through them."""
