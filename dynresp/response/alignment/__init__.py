"""Time alignment: exit from the simulation and entry into the reaction."""
