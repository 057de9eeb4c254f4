"""Small motions, and reactions to align with them."""

import math

import numpy as np

from dynresp.motion import rotations
from dynresp.response.alignment.alignment import Aligner, Alignment, AlignmentConfig
from dynresp.response.windows.windows import ReactionTrack, WindowErrorConfig
from studies.benchmarks.full_search_speed import synthetic_track
from tests.oracles.alignment import Track, interpolated

BODIES = 5
WINDOW = WindowErrorConfig(fps=30.0, window_s=5 / 30, exit_min_s=2 / 30, exit_max_s=12 / 30)
FRAMES = 12 + 5
ALL = AlignmentConfig(sets_without_gain=99)


def smooth_track(seed: int, frames: int = FRAMES, bodies: int = BODIES) -> Track:
    rest = np.random.default_rng(99).normal(scale=0.4, size=(bodies, 3))
    return synthetic_track(np.random.default_rng(seed), rest, frames)


def flipped(track: Track, seed: int) -> Track:
    """The same motion, half of its quaternions with the other sign."""
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(*track[1].shape[:2], 1))
    return track[0], track[1] * signs


def placed(track: Track, x: float, y: float, yaw: float) -> Track:
    turn = rotations.from_yaw(yaw)
    moved = rotations.rotate(turn, track[0]) + np.array([x, y, 0.0])
    return moved, rotations.multiply(turn, track[1])


def reactions(*seeds: int, frames: int = 24) -> list[ReactionTrack]:
    return [ReactionTrack(f"reaction {seed}", *smooth_track(seed, frames)) for seed in seeds]


def align_one(aligner: Aligner, trace: Track, reaction: str | None = None) -> Alignment:
    return aligner.align(*trace, [reaction or aligner.names[0]])[0]


def sliding(offset: float, frames: int = 40) -> tuple[Track, ReactionTrack]:
    """A reaction, and a trace that is the reaction from `offset` frames on."""
    clip = smooth_track(3, frames)
    return interpolated(clip, offset, FRAMES), ReactionTrack("itself", *clip)


def _nan_position(track: Track) -> Track:
    track[0][3, 2, 1] = math.nan
    return track


def _infinite_quaternion(track: Track) -> Track:
    track[1][3, 2, 1] = math.inf
    return track


def _long_quaternion(track: Track) -> Track:
    track[1][3, 2] *= 1.1
    return track


def _without_quaternions(track: Track) -> Track:
    return track[0], track[1][..., :3]


BAD_TRACKS = [
    (_nan_position, "not finite, the first at frame 3, body 2"),
    (_infinite_quaternion, "not finite, the first at frame 3, body 2"),
    (_long_quaternion, "frame 3, body 2 has length 1.1"),
    (_without_quaternions, "expected .frames, bodies, 3."),
]
"""What makes a track unusable, and what the message says (a regular expression)."""
