"""Control by sketch."""
