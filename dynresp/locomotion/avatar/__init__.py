"""Avatars that walk by graph, are hit, and walk on."""
