"""From the simulation back to motion capture: the blend and the motion after it."""
