"""Control by choice."""
