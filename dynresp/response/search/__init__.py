"""Full search: all reactions and the base motion compared with what physics shows."""
