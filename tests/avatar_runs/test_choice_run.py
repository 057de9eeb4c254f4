import numpy as np
import pytest

from dynresp.avatar_runs.choice_run import in_words
from dynresp.locomotion.choice.actions import OfferedAction


def action(*corners: tuple[float, float, float]) -> OfferedAction:
    """One whose root goes through corners x, y [m] and yaw [deg], a frame each."""
    path = np.array([[x, y, 0.9, np.radians(yaw)] for x, y, yaw in corners])
    frames = np.arange(len(path) - 1, dtype=np.int32)
    return OfferedAction(0, frames, path, 0, np.zeros(2, np.int32), 0, np.zeros(59), -1.0)


@pytest.mark.parametrize(
    ("corners", "said"),
    [
        (((0, 0, 0), (2, 0, 10)), "goes 2.0 m ahead, in 1.0 s"),
        (((0, 0, 90), (2, 0, 0)), "goes 2.0 m to the right, turns 90 deg right, in 1.0 s"),
        (((0, 0, 0), (-1, 0, 0)), "goes 1.0 m back, in 1.0 s"),
        (((0, 0, 0), (1, 1, 45)), "goes 1.4 m ahead and to the left, turns 45 deg left, in 1.0 s"),
        (((0, 0, 0), (0.1, 0, 0)), "stays, in 1.0 s"),
        (((0, 0, 0), (2, 0, 0), (0.2, 0, 0)), "goes 3.8 m and comes back, in 2.0 s"),
        (((5, 5, 165), (5, 5, -165)), "stays, turns 30 deg left, in 1.0 s"),
    ],
)
def test_actions_in_words(corners: tuple[tuple[float, float, float], ...], said: str) -> None:
    assert in_words(action(*corners), 1.0) == said
