"""Full search: compares all reactions and the base motion with the simulation."""
