"""The hit in MuJoCo: the scene, the servos, what hits, and many simulations at once."""
