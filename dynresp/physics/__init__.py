"""Simulation of hits in MuJoCo: the scene, the servos, impacts, and batches of simulations."""
