"""Experiments and libraries that the tests make themselves."""

from pathlib import Path

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.export import write_npz
from dynresp.motion.motion import Motion

FPS = 30.0

BALL = """\
[experiment]
name = "A test"
seed = 3

[base]
motion = "stand.npz"

[[impact]]
kind = "ball"
time_s = 1.0
mass_kg = 6
speed_m_s = 7
from_deg = 10

[library]
which = "library.toml"

[output]
video_size_px = [128, 96]
video_fps = 10
"""
"""An experiment on the files that `write_world` makes."""


def swaying(character: Character, seconds: float, back_deg: float) -> Motion:
    """Standing, bent back in the waist and up again over the given time."""
    frames = round(seconds * FPS) + 1
    angle = np.radians(back_deg) * np.sin(np.linspace(0.0, np.pi, frames))
    poses = np.repeat(character.rest_pose[None], frames, axis=0)
    column = 7 + 4 * character.joint("waist")
    vectors = np.stack([0 * angle, -angle, 0 * angle], axis=1)
    poses[:, column : column + 4] = rotations.from_rotation_vector(vectors)
    return Motion(poses, FPS, f"sway {back_deg:g}")


def write_world(folder: Path, character: Character) -> Path:
    """A folder with a base motion, two reactions, their library and an experiment.

    Returns:
        The experiment file.
    """
    write_npz(swaying(character, 4.0, 2.0), folder / "stand.npz", character)
    write_npz(swaying(character, 2.0, 25.0), folder / "motions" / "back.npz", character)
    write_npz(swaying(character, 2.0, -20.0), folder / "motions" / "front.npz", character)
    (folder / "library.toml").write_text(
        "".join(
            f'[[reaction]]\nname = "{name}"\nstrategy = "{strategy}"\n'
            f'file = "{file}.npz"\nframes = [0, 60]\n\n'
            for name, strategy, file in (
                ("bend_back", "upper_body_front", "back"),
                ("bend_forward", "upper_body_back", "front"),
            )
        ),
        encoding="utf-8",
    )
    experiment = folder / "experiment.toml"
    experiment.write_text(BALL, encoding="utf-8")
    return experiment
