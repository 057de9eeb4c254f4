"""Plans against arrays that hold every frame."""

import numpy as np
import pytest

from dynresp.motion import rotations
from dynresp.motion.motion import move_poses
from dynresp.motion.rotations import FloatArray
from dynresp.response.transition.pose_timeline import Plan
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
    rng: np.random.Generator, plan: Plan, twin: FloatArray, what: int
) -> tuple[Plan, FloatArray]:
    poses = _poses(rng, int(rng.integers(1, 30)))
    first = int(rng.integers(0, 80))
    row = first - FIRST
    if what == 0:
        twin = twin.copy()
        twin[row:] = _written(poses, first)[row:]
        return plan.laid(poses, first), twin
    if what == 1:
        twin = twin.copy()
        twin[row : row + len(poses)] = poses
        return plan.patched(poses, first), twin
    turn, shift = float(rng.uniform(-3.0, 3.0)), np.array([*rng.normal(size=2), 0.0])
    later = int(rng.integers(-3, 4))
    moved = move_poses(twin, turn, shift)
    return plan.moved(later, turn, shift), moved[
        np.clip(np.arange(len(moved)) - later, 0, len(moved) - 1)
    ]


@pytest.mark.parametrize("seed", range(40))
def test_a_plan_reads_as_what_was_written_frame_by_frame(seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = _poses(rng, 50)
    plan, twin = Plan.of(poses, 0), _written(poses, 0)
    for _ in range(6):
        plan, twin = _change(rng, plan, twin, int(rng.integers(0, 3)))
        first = int(rng.integers(0, 60))
        np.testing.assert_allclose(
            plan.read(first, 40), twin[first - FIRST : first - FIRST + 40], atol=1e-12
        )
        kept = plan.since(first)
        np.testing.assert_array_equal(kept.read(first, 40), plan.read(first, 40))
        assert kept.end >= first
    np.testing.assert_allclose(plan.read(plan.end + 5, 1), plan.read(plan.end - 1, 1))


def test_what_is_past_is_forgotten(rng: np.random.Generator) -> None:
    plan = Plan.of(_poses(rng, 10), 0)
    for first in range(10, 1000, 10):
        plan = plan.since(first - 5).laid(_poses(rng, 10), first)
    assert len(plan.stretches) == 2
    assert plan.end == 1000


def test_a_plan_is_placed_as_a_reaction_is(rng: np.random.Generator) -> None:
    poses, onto = _poses(rng, 20), _poses(rng, 1)[0]
    placed = Plan.of(poses, 100).placed_on(onto, 107)
    np.testing.assert_array_equal(placed.read(100, 20), place_on(poses, 7, onto))
    later = Plan.of(poses, 100).placed_on(onto, 107, 4)
    np.testing.assert_array_equal(later.read(104, 20), place_on(poses, 3, onto))
