"""Settings of the mismatch (window error), and of the search for the best pair of windows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynresp.motion.rotations import FloatArray
from dynresp.support.checks import check_number
from dynresp.support.errors import UsageError


@dataclass(frozen=True)
class WindowErrorConfig:
    """Settings of the mismatch (window error) and of the search.

    Attributes:
        fps: Frame rate of the simulated trace and of every reaction clip [1/s].
        window_s: Length of the windows that are compared [s].
        exit_min_s: Earliest exit after contact [s].
        exit_max_s: Latest exit [s]; every frame from the earliest to the latest is tried.
        entry_step_s: Time between the entries that are tried [s].
        position_weight: Weight of a metre between two bodies; one number for all bodies or one
            for each.
        angle_weight: Weight of a radian between two bodies [m/rad]; one number or one for each
            body. The far end of a body segment moves by about 0.2 m when it turns by a radian.
    """

    fps: float
    window_s: float = 1.0 / 3.0
    exit_min_s: float = 0.0
    exit_max_s: float = 0.5
    entry_step_s: float = 1.0 / 30.0
    position_weight: float | tuple[float, ...] = 1.0
    angle_weight: float | tuple[float, ...] = 0.2

    def __post_init__(self) -> None:
        """Check every value.

        Raises:
            UsageError: A value is out of range; the message names it.
        """
        check_number("fps", self.fps, 0.0, above_low=True)
        check_number("window_s", self.window_s, 0.0, unit="s", above_low=True)
        check_number("exit_min_s", self.exit_min_s, 0.0, unit="s")
        check_number("exit_max_s", self.exit_max_s, self.exit_min_s, unit="s")
        check_number("entry_step_s", self.entry_step_s, 0.0, unit="s", above_low=True)
        weights: list[float] = []
        for name in ("position_weight", "angle_weight"):
            value = getattr(self, name)
            values = value if isinstance(value, tuple) else (value,)
            for weight in values:
                check_number(name, weight, 0.0)
            weights.extend(values)
        if not any(weights):
            raise UsageError(
                "position_weight and angle_weight are all zero, so all windows would be equal; "
                "expected a weight above zero for at least one body"
            )

    @property
    def window_frames(self) -> int:
        """Frames in a window, at least one."""
        return max(1, round(self.window_s * self.fps))

    @property
    def exit_frames(self) -> range:
        """Exits: frames of the trace, counted from contact."""
        return range(round(self.exit_min_s * self.fps), round(self.exit_max_s * self.fps) + 1)

    @property
    def entry_step(self) -> int:
        """Frames from one entry that is tried to the next, at least one."""
        return max(1, round(self.entry_step_s * self.fps))

    def frame_weights(self) -> FloatArray:
        """Weights w_i of the frames of a window, shape (window_frames,), summing to one.

        Quadratic, highest at the start and falling to nearly zero at the end, as in Zordan et al.
        2005 (Dynamic response for motion capture animation): the first frames, at the transition,
        should match best.
        """
        frames = self.window_frames
        weights: FloatArray = (1.0 - np.arange(frames) / frames) ** 2
        return np.asarray(weights / weights.sum())

    def body_weights(self, bodies: int) -> tuple[FloatArray, FloatArray]:
        """Weights of position and of angle for each body, two arrays of shape (bodies,).

        Raises:
            UsageError: A weight was given per body, for another number of bodies.
        """
        rows = []
        for name in ("position_weight", "angle_weight"):
            value = getattr(self, name)
            if isinstance(value, tuple) and len(value) != bodies:
                raise UsageError(
                    f"{name} has {len(value)} values, the character has {bodies} bodies; expected "
                    "one number for all bodies or one for each"
                )
            rows.append(np.broadcast_to(np.asarray(value, dtype=np.float64), (bodies,)))
        return rows[0], rows[1]
