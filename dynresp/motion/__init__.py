"""Motions of one character: rotations, poses, readers, retargeting, the reaction library."""
