"""Feet that stand between two frames of a graph."""

import numpy as np

from dynresp.locomotion.playing.stance_steps import keep_feet_planted
from dynresp.motion.character import Character
from dynresp.motion.motion import interpolate_with_velocities
from dynresp.motion.rotations import FloatArray
from tests.motion.foot_samples import crouched, foot_states
from tests.physics.samples import standing


def _carried_on(character: Character) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Poses among knots of one who stands while all joints of both legs still move.

    Returns:
        Two knots (2, 59), the parts of the way between them (n,), and cubics there (n, 59).
    """
    knots = crouched(character, standing(character, 1.0, 15.0).poses)[:2].copy()
    knots[1, :3] += (0.05, 0.01, -0.01)
    knots[1] = crouched(character, knots[1:])[0]
    velocity = np.zeros((1, 45))
    velocity[0, 3 + 3 * 7 :] = 1.5
    part = np.linspace(0.0, 1.0, 9)
    ends = [np.repeat(x[None], 9, axis=0) for x in knots]
    moving = np.repeat(velocity, 9, axis=0)
    return knots, part, interpolate_with_velocities(*ends, moving, -moving, part, 1.0 / 15.0)


def test_a_foot_goes_straight_and_the_rest_is_as_it_was(character: Character) -> None:
    knots, part, poses = _carried_on(character)
    held = np.zeros((9, 2), dtype=bool)
    held[:, 0] = True
    step = np.zeros(9, dtype=np.intp)
    out = keep_feet_planted(character, poses, (knots[:1], knots[1:]), step, part, held)
    np.testing.assert_array_equal(out[[0, -1]], poses[[0, -1]])
    legs = [7 + 4 * character.joint(f"left_{x}") for x in ("hip", "knee", "ankle")]
    others = np.setdiff1d(np.arange(59), [k + i for k in legs for i in range(4)])
    np.testing.assert_array_equal(out[:, others], poses[:, others])
    before, after = (foot_states(character, x)[0][:, 0] for x in (poses, out))
    ends = foot_states(character, knots)[0][:, 0]
    straight = ends[0] + part[:, None] * (ends[1] - ends[0])
    assert np.abs(before - straight).max() > 5e-3
    # All but what the foot turns about a corner of its sole.
    turned = np.abs(foot_states(character, out)[1][:, 0] - foot_states(character, poses)[1][:, 0])
    assert turned.max() < 1e-9
    assert np.abs(after - straight).max() < 0.5 * np.abs(before - straight).max()


def test_nothing_is_led_that_does_not_stand(character: Character) -> None:
    knots, part, poses = _carried_on(character)
    air = np.zeros((9, 2), dtype=bool)
    out = keep_feet_planted(character, poses, (knots[:1], knots[1:]), np.zeros(9, int), part, air)
    np.testing.assert_array_equal(out, poses)
