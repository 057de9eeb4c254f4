"""Feet fitted while the motion is played, and the legs that bring them where they are to be."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from dynresp.motion import rotations
from dynresp.motion.character import Character, default_character
from dynresp.motion.feet import legs
from dynresp.motion.feet.foot_fitting import ComposedMotion, fit_feet, look_ahead_frames
from dynresp.motion.motion import FEET, Motion
from tests.motion.foot_samples import (
    BLEND_S,
    FPS,
    crouched,
    drifting,
    foot_states,
    jumping,
    same_poses,
    standing_over,
    unjumped,
    worst_slide,
)
from tests.oracles import foot_fitting
from tests.physics.samples import standing

seeds = st.integers(0, 2**32 - 1)


class TestPieces:
    """A motion that is fitted while it is played."""

    def test_what_was_shown_is_kept(self, character: Character, rng: np.random.Generator) -> None:
        composed = jumping(character, rng, 2)
        shown = fit_feet(character, composed)[:50]
        again = fit_feet(character, replace(composed, fitted=shown))
        np.testing.assert_array_equal(again[:50], shown)

    def test_pieces_with_look_ahead_are_the_whole(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        motion = drifting(character, rng, 10.0)
        whole = fit_feet(character, unjumped(motion))
        ahead, step = look_ahead_frames(FPS), 17
        shown = whole[:0]
        for start in range(0, len(motion) - ahead - step, step):
            stop = start + step + ahead
            piece = Motion(motion.poses[:stop], FPS, "", motion.contacts[:stop])
            shown = fit_feet(character, unjumped(piece, shown))[: start + step]
        same_poses(shown, whole[: len(shown)], 2e-3)

    @given(seed=seeds, at=st.integers(20, 60))
    @settings(max_examples=15)
    def test_a_plan_that_changes_makes_no_leap(self, seed: int, at: int) -> None:
        """Up to some frame it was fitted as one motion; from there on it is another."""
        character = default_character()
        rng = np.random.default_rng(seed)
        composed = jumping(character, rng, 1)
        at = min(at, int(np.asarray(composed.jumps)[0]))
        cut = Motion(
            composed.source[:at] + np.append(rng.normal(scale=0.01, size=2), np.zeros(57)),
            FPS, "", composed.contacts[:at],
        )  # fmt: skip
        shown = fit_feet(character, unjumped(cut))
        again = fit_feet(character, replace(composed, fitted=shown))
        ankles, _ = foot_states(character, again)
        played, _ = foot_states(character, composed.poses)
        extra = np.diff(ankles - played, axis=0)[at - 1]
        assert np.linalg.norm(extra, axis=-1).max() < 0.02

    def test_a_foot_that_slides_when_taken_over_comes_to_rest(self, character: Character) -> None:
        poses = crouched(character, standing(character, 2.0, FPS).poses)
        poses[:, 0] += 0.3 / FPS * np.arange(len(poses))
        contacts = np.ones((len(poses), 2), dtype=bool)
        composed = ComposedMotion(poses, poses, contacts, [], FPS, BLEND_S, fitted=poses[:10])
        ankles, _ = foot_states(character, fit_feet(character, composed))
        ways = np.linalg.norm(np.diff(ankles[:, 0, :2], axis=0), axis=-1)
        np.testing.assert_allclose(ways[:9], 0.01, atol=1e-9)
        assert np.all(np.diff(ways[8:13]) <= 1e-9)
        assert ways[12:25].max() < 1e-9


class TestLegs:
    """Two-bone inverse kinematics against a general solver."""

    def test_equals_mink(self, character: Character, rng: np.random.Generator) -> None:
        composed = jumping(character, rng, 2)
        fitted = fit_feet(character, composed)
        moved = np.flatnonzero(np.abs(fitted - composed.poses).max(axis=1) > 1e-3)
        assert len(moved) > 20
        ankles, feet = foot_states(character, fitted)
        for k in moved[:: max(1, len(moved) // 12)]:
            start = composed.poses[k].copy()
            start[2] = fitted[k, 2]
            solved = foot_fitting.place_feet(character, start, ankles[k], feet[k])
            theirs = foot_states(character, solved[None])
            np.testing.assert_allclose(theirs[0][0], ankles[k], atol=1e-3)
            off = rotations.angle_between(theirs[1][0], feet[k])
            assert np.degrees(off).max() < 0.5
            for side in FEET:
                knee = character.body(f"{side}_shank")
                both = character.kinematics(np.stack([solved, fitted[k]])).positions[:, knee]
                assert np.linalg.norm(both[0] - both[1]) < 0.02

    def test_the_root_is_lowered_for_legs_that_are_too_short(self, character: Character) -> None:
        composed, _ = standing_over(character, 0.19, crouch=0.02)
        fitted = fit_feet(character, composed)
        lowered = composed.poses[:, 2] - fitted[:, 2]
        assert lowered.max() > 1e-3
        ankles, _ = foot_states(character, fitted)
        states = character.kinematics(fitted)
        hips = states.positions[:, [character.body(f"{side}_thigh") for side in FEET]]
        reach = np.linalg.norm(hips - ankles, axis=-1)
        assert reach.max() <= max(0.99 * 0.8625, legs.MAX_STRETCH * 0.8625) + 1e-6
        assert worst_slide(character, fitted, composed.contacts) < 1e-6
