"""Timelines against arrays that hold every frame."""

import numpy as np
import pytest

from dynresp.motion import rotations
from dynresp.motion.motion import move_poses
from dynresp.motion.rotations import FloatArray
from dynresp.response.transition.pose_timeline import PoseTimeline
from dynresp.response.transition.transition import place_on

# The frames that the slow twin writes out.
FIRST, LAST = -40, 160


def _poses(rng: np.random.Generator, frames: int) -> FloatArray:
    quaternions = rotations.normalize(rng.normal(size=(frames, 14, 4)))
    return np.concatenate([rng.normal(size=(frames, 3)), quaternions.reshape(frames, -1)], axis=1)


def _written(poses: FloatArray, first: int) -> FloatArray:
    at = np.clip(np.arange(FIRST, LAST) - first, 0, len(poses) - 1)
    return poses[at]


def _change(
    rng: np.random.Generator, timeline: PoseTimeline, twin: FloatArray, what: int
) -> tuple[PoseTimeline, FloatArray]:
    poses = _poses(rng, int(rng.integers(1, 30)))
    first = int(rng.integers(0, 80))
    row = first - FIRST
    if what == 0:
        twin = twin.copy()
        twin[row:] = _written(poses, first)[row:]
        return timeline.replaced_from(poses, first), twin
    if what == 1:
        twin = twin.copy()
        twin[row : row + len(poses)] = poses
        return timeline.replaced_within(poses, first), twin
    turn, shift = float(rng.uniform(-3.0, 3.0)), np.array([*rng.normal(size=2), 0.0])
    delay = int(rng.integers(-3, 4))
    moved = move_poses(twin, turn, shift)
    return timeline.moved(delay, turn, shift), moved[
        np.clip(np.arange(len(moved)) - delay, 0, len(moved) - 1)
    ]


@pytest.mark.parametrize("seed", range(40))
def test_a_timeline_reads_as_if_written_frame_by_frame(seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = _poses(rng, 50)
    timeline, twin = PoseTimeline.of(poses, 0), _written(poses, 0)
    for _ in range(6):
        timeline, twin = _change(rng, timeline, twin, int(rng.integers(0, 3)))
        first = int(rng.integers(0, 60))
        np.testing.assert_allclose(
            timeline.read(first, 40), twin[first - FIRST : first - FIRST + 40], atol=1e-12
        )
        kept = timeline.without_before(first)
        np.testing.assert_array_equal(kept.read(first, 40), timeline.read(first, 40))
        assert kept.end >= first
    np.testing.assert_allclose(
        timeline.read(timeline.end + 5, 1), timeline.read(timeline.end - 1, 1)
    )


def test_the_past_is_dropped(rng: np.random.Generator) -> None:
    timeline = PoseTimeline.of(_poses(rng, 10), 0)
    for first in range(10, 1000, 10):
        timeline = timeline.without_before(first - 5).replaced_from(_poses(rng, 10), first)
    assert len(timeline.pieces) == 2
    assert timeline.end == 1000


def test_a_timeline_is_placed_as_a_reaction_is(rng: np.random.Generator) -> None:
    poses, onto = _poses(rng, 20), _poses(rng, 1)[0]
    placed = PoseTimeline.of(poses, 100).placed_on(onto, 107)
    np.testing.assert_array_equal(placed.read(100, 20), place_on(poses, 7, onto))
    delayed = PoseTimeline.of(poses, 100).placed_on(onto, 107, 4)
    np.testing.assert_array_equal(delayed.read(104, 20), place_on(poses, 3, onto))
