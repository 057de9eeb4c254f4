"""Worlds an avatar walks in: obstacles, mazes, and paths through them."""
