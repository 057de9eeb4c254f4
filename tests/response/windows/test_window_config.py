"""Settings of windows: their frames and weights, and values that are refused."""

import dataclasses
import math

import numpy as np
import pytest

from dynresp.response.windows.window_config import WindowErrorConfig
from dynresp.support.errors import UsageError

CONFIG = WindowErrorConfig(fps=30.0, window_s=5 / 30, exit_max_s=6 / 30)


def test_durations_become_frames_at_the_given_rate() -> None:
    default = WindowErrorConfig(fps=30.0)
    assert default.window_frames == 10
    assert default.exit_frames == range(16)
    assert default.entry_step == 1
    fast = WindowErrorConfig(fps=120.0, exit_min_s=0.1)
    assert fast.window_frames == 40
    assert fast.exit_frames == range(12, 61)
    assert fast.entry_step == 4
    weights = default.frame_weights()
    assert weights.sum() == pytest.approx(1.0)
    assert np.all(np.diff(weights) < 0)
    assert weights[-1] == pytest.approx(0.01 * weights[0])


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("fps", 0.0),
        ("fps", math.nan),
        ("window_s", -1.0),
        ("exit_min_s", -0.1),
        ("exit_max_s", -0.1),
        ("entry_step_s", 0.0),
        ("position_weight", -1.0),
        ("angle_weight", (0.1, math.inf)),
    ],
)
def test_values_out_of_range_are_named(field: str, value: object) -> None:
    with pytest.raises(UsageError, match=field):
        dataclasses.replace(CONFIG, **{field: value})  # type: ignore[arg-type]


def test_weights_of_zero_and_of_the_wrong_length_are_refused() -> None:
    with pytest.raises(UsageError, match="all zero"):
        dataclasses.replace(CONFIG, position_weight=0.0, angle_weight=(0.0, 0.0))
    config = dataclasses.replace(CONFIG, angle_weight=(0.2, 0.2))
    with pytest.raises(UsageError, match="2 values, the character has 5"):
        config.body_weights(5)
