"""Graph-based locomotion."""
