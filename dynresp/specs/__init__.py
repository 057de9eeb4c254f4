"""TOML files that users write: one reader, one translator of mistakes, fixed and drawn values."""
