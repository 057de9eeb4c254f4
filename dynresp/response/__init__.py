"""The answer to a hit: search, transition, the whole way, and how good it is."""
