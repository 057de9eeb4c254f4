"""Speed of the full search, beside vectorised NumPy and its readable twin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from dynresp.bench.machine import describe_machine
from dynresp.bench.measure import BenchResult, Contender, median_seconds
from dynresp.motion import rotations
from dynresp.motion.rotations import FloatArray
from dynresp.response.search import full_search
from dynresp.response.windows.windows import (
    ReactionTrack,
    WindowErrorConfig,
    WindowSet,
    library_windows,
    trace_windows,
)
from dynresp.support.errors import DynrespError
from studies.benchmarks import window_error_twin

REACTIONS = 24
"""Reactions in the synthetic library."""
ENTRIES = 100
"""Entry frames of each."""
# 15 exits, 0 to 14 frames after contact, with windows of 10 frames.
SIZE = WindowErrorConfig(fps=30.0, exit_max_s=14.0 / 30.0)
_BODIES = 14
_ROUNDS = 30
_TWIN_EVERY = 10

Track = tuple[FloatArray, FloatArray]


def run(
    seed: int = 0,
    *,
    trace: Track | None = None,
    reactions: Sequence[ReactionTrack] | None = None,
    config: WindowErrorConfig = SIZE,
) -> BenchResult:
    """Measure the search of a library on one thread; takes about five seconds.

    Args:
        seed: Seed of the synthetic motion, where none is given.
        trace: Positions (frames, bodies, 3) [m] and quaternions (frames, bodies, 4) of a
            simulated trace; None for synthetic motion.
        reactions: The library; None for `REACTIONS` synthetic ones of `ENTRIES` entries each.
        config: Windows and weights.

    Returns:
        `value` is the search as it is used, in milliseconds a reaction. The further figures hold
        the same with every pair of windows evaluated to its end, and both ratios to the twin.

    Raises:
        MotionError: The full search refuses the given motion.
        DynrespError: The three sides disagree, which would make their times meaningless.
    """
    rng = np.random.default_rng(seed)
    rest = rng.normal(scale=(0.15, 0.2, 0.4), size=(_BODIES, 3))
    if trace is None:
        trace = synthetic_track(rng, rest, config.exit_frames[-1] + config.window_frames)
    if reactions is None:
        frames = ENTRIES + config.window_frames - 1
        reactions = [
            ReactionTrack(f"synthetic {i}", *synthetic_track(rng, rest, frames))
            for i in range(REACTIONS)
        ]
    windows = trace_windows(*trace, config)
    library = library_windows(reactions, config)
    baseline = NumpySurface(windows)
    operands = [baseline.prepare(w) for w in library.windows]
    first = reactions[0]
    entries = library.windows[0].starts.tolist()
    twin_surface: list[npt.NDArray[np.float64]] = []

    def twin() -> None:
        twin_surface[:] = [
            window_error_twin.error_surface(
                trace, (first.positions, first.quaternions), config.exit_frames, entries, config
            )
        ]

    def numpy_side() -> list[np.float32]:
        return [baseline(operand).min() for operand in operands]

    found = full_search.search(windows, library)
    expected = np.array(numpy_side())
    times = median_seconds(
        [
            Contender("search", lambda: full_search.search(windows, library)),
            Contender("every pair", lambda: full_search.search(windows, library, early_stop=False)),
            Contender("numpy", numpy_side),
            Contender("twin", twin, every=_TWIN_EVERY),
        ],
        _ROUNDS,
    )
    _check_agreement(found.errors, expected, "vectorised NumPy")
    _check_agreement(found.surface(first.name).errors, twin_surface[0], "the readable twin")
    count = len(reactions)
    search, every_pair = 1e3 * times["search"] / count, 1e3 * times["every pair"] / count
    numpy, slow = 1e3 * times["numpy"] / count, 1e3 * times["twin"]
    # The twin was timed on the first reaction; bring it to the size of the average one.
    pairs = len(windows) * sum(len(w) for w in library.windows) / count
    slow *= pairs / (len(windows) * len(entries))
    return BenchResult(
        name="search",
        value=search,
        unit="ms/reaction",
        baseline=numpy,
        baseline_name="vectorised NumPy over the same windows",
        ratio=numpy / search,
        machine=describe_machine(("numpy", "numba")),
        more={
            "ratio_twin": slow / search,
            "twin": slow,
            "every_pair": every_pair,
            "every_pair_ratio": numpy / every_pair,
            "every_pair_ratio_twin": slow / every_pair,
            "reactions": count,
            "pairs_per_reaction": pairs,
            "window_frames": config.window_frames,
            "bodies": windows.bodies,
            "seed": seed,
        },
        notes=(
            "All times in ms/reaction on one thread, medians of interleaved rounds.",
            "The search skips pairs that can no longer win, with the same result; how many depends "
            "on the motion. every_pair compares all of them, as NumPy and the twin do.",
        ),
    )


def synthetic_track(rng: np.random.Generator, rest: FloatArray, frames: int) -> Track:
    """Smooth random motion of a body at 30 frames a second.

    Args:
        rng: Source of the motion.
        rest: (bodies, 3) places of the bodies relative to the pelvis [m].
        frames: Length.

    Returns:
        Positions (frames, bodies, 3) [m] and quaternions (frames, bodies, 4), w x y z.
    """
    time = np.arange(frames) / 30.0
    waves = 4

    def smooth(size: float) -> FloatArray:
        shape = (waves, len(rest), 3)
        rate, phase = rng.uniform(0.5, 8.0, shape), rng.uniform(0.0, 2.0 * np.pi, shape)
        height = rng.normal(scale=size / waves, size=shape)
        angle = rate[..., None] * time + phase[..., None]
        total: FloatArray = (height[..., None] * np.sin(angle)).sum(axis=0)
        return total.transpose(2, 0, 1)

    turn = rotations.from_yaw(rng.uniform(-np.pi, np.pi))
    travel = rng.normal(size=3) * (1.0, 1.0, 0.0) * time[:, None]
    local = rest + smooth(0.3) + travel[:, None] + (0.0, 0.0, 0.95)
    quaternions = rotations.from_rotation_vector(smooth(1.2))
    return rotations.rotate(turn, local), rotations.multiply(turn, quaternions)


class NumpySurface:
    """The fastest method found to compute all window errors in NumPy to the kernel's accuracy.

    Squared distances and quaternion products of all pairs are matrix products in double precision,
    where the cancellation they bring is harmless; square roots and arcsines, which are most of the
    time, run in single precision with NumPy's vector instructions. Frame by frame, so that what is
    worked on stays in the cache, and without allocating. Plain broadcasting takes two to three
    times as long.
    """

    def __init__(self, trace: WindowSet) -> None:
        """Lay out the windows of the trace once."""
        config = trace.config
        frame_weights = config.frame_weights()[:, None]
        position_weight, angle_weight = config.body_weights(trace.bodies)
        self._position_weights = (frame_weights * position_weight).astype(np.float32)
        # angle = 4 asin(chord / 2)
        self._angle_weights = (4.0 * frame_weights * angle_weight).astype(np.float32)
        position, square, quaternion = _split(trace)
        one = np.ones_like(square)
        rows = np.concatenate([-2.0 * position, square, one], axis=2)
        self._positions = np.ascontiguousarray(rows.swapaxes(2, 3))
        self._quaternions = np.ascontiguousarray(0.5 * quaternion.swapaxes(2, 3))

    def prepare(self, entries: WindowSet) -> Track:
        """Lay out the windows of a reaction once."""
        position, square, quaternion = _split(entries)
        return np.concatenate([position, np.ones_like(square), square], axis=2), quaternion

    def __call__(self, entries: Track) -> npt.NDArray[np.float32]:
        """Errors of all pairs, (exits, entries) [m]."""
        positions, quaternions = entries
        frames, bodies, exits, _ = self._positions.shape
        product = np.empty((bodies, exits, positions.shape[3]))
        value = np.empty(product.shape, dtype=np.float32)
        flat = value.reshape(bodies, -1)
        errors = np.zeros(flat.shape[1], dtype=np.float32)
        for i in range(frames):
            np.matmul(self._positions[i], positions[i], out=product)
            np.maximum(product, 0.0, out=value, casting="same_kind")
            np.sqrt(value, out=value)
            errors += self._position_weights[i] @ flat
            np.matmul(self._quaternions[i], quaternions[i], out=product)
            # The squared half chord to the nearer of q and -q is (1 - |q q'|) / 2.
            np.abs(product, out=product)
            np.subtract(0.5, product, out=value, casting="same_kind")
            np.maximum(value, 0.0, out=value)
            np.sqrt(value, out=value)
            np.arcsin(value, out=value)
            errors += self._angle_weights[i] @ flat
        return errors.reshape(exits, -1)


def _split(windows: WindowSet) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Positions, their squared lengths, and unit quaternions: (frames, bodies, rows, windows)."""
    data = windows.data[..., : len(windows)].astype(np.float64)
    position, quaternion = data[:, :, :3], data[:, :, 3:]
    square = np.sum(position**2, axis=2, keepdims=True)
    return position, square, quaternion / np.linalg.norm(quaternion, axis=2, keepdims=True)


def _check_agreement(
    found: npt.NDArray[np.float32], expected: npt.NDArray[np.floating], other: str
) -> None:
    """Refuse to report times of sides that do not compute the same."""
    if not np.allclose(found, expected, rtol=1e-4, atol=full_search.ERROR_FLOOR):
        worst = float(np.max(np.abs(found - expected)))
        raise DynrespError(
            f"the kernel and {other} differ by up to {worst:.3g} m, expected at most 1e-4 relative "
            f"plus {full_search.ERROR_FLOOR} m. Please report this with the machine it happened on."
        )
