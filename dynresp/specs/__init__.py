"""TOML files that users write: one reader, one translator of errors, fixed and drawn values."""
