"""Feet that are held where they stand, and all that must not suffer from it."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from dynresp.motion import rotations
from dynresp.motion.character import Character, default_character
from dynresp.motion.feet import foot_fitting as foot_fitting_module
from dynresp.motion.feet.foot_fitting import MAX_ROOT_DROP, STANCE_S, ComposedMotion, fit_feet
from dynresp.motion.feet.foot_fitting_place_kernel import into_discs
from dynresp.motion.feet.skating import TOUCH, stance_slides
from dynresp.motion.ground import clearances, sole_points
from dynresp.motion.load import LoadOptions, load_motion
from dynresp.motion.motion import FEET, Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import MotionError
from tests.motion.foot_samples import (
    BLEND_S,
    FPS,
    crouched,
    dragged,
    drifting,
    foot_states,
    jumping,
    same_poses,
    standing_over,
    unjumped,
    walk,
    worst_slide,
)
from tests.oracles import foot_fitting
from tests.physics.samples import standing

_into_discs = njit(lambda x, y, discs: into_discs(x, y, discs))

seeds = st.integers(0, 2**32 - 1)


class TestStances:
    """Feet that stand."""

    @given(seed=seeds)
    @settings(max_examples=15)
    def test_a_recording_that_slides_does_so_no_more(self, seed: int) -> None:
        character = default_character()
        motion = drifting(character, np.random.default_rng(seed))
        assert worst_slide(character, motion.poses, motion.contacts) > 1e-3
        fitted = fit_feet(character, unjumped(motion))
        assert worst_slide(character, fitted, motion.contacts) < 1e-6

    @given(seed=seeds, cuts=st.integers(1, 4))
    @settings(max_examples=25)
    def test_nor_do_blends_that_overlap(self, seed: int, cuts: int) -> None:
        character = default_character()
        composed = jumping(character, np.random.default_rng(seed), cuts)
        fitted = fit_feet(character, composed)
        assert worst_slide(character, composed.poses, composed.contacts) > 2e-3
        # A corner that by rounding does or does not touch.
        assert worst_slide(character, fitted, composed.contacts) < 3e-4

    def test_equal_their_twin(
        self, character: Character, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Without a jump: each stance by plain loops, each swing by textbook cubics."""
        motion = drifting(character, rng, 4.0)
        # Legs that are bent reach everywhere.
        motion = replace(motion, poses=crouched(character, motion.poses))
        monkeypatch.setattr(foot_fitting_module, "EASE_S", 10.0)
        monkeypatch.setattr(foot_fitting_module, "MAX_SHIFT_SPEED", 100.0)
        ankles, feet = foot_states(character, motion.poses)
        got, _ = foot_states(character, fit_feet(character, unjumped(motion)))
        for i, side in enumerate(FEET):
            sole = sole_points(character, side)
            turns = foot_fitting.as_rotation(feet[:, i])
            edges = np.flatnonzero(np.diff(np.pad(motion.contacts[:, i], 1).astype(int)))
            stances = edges.reshape(-1, 2)
            shift = np.full((len(motion), 2), np.nan)
            for a, b in stances:
                way = foot_fitting.unslid(ankles[a:b, i], turns[a:b], sole, TOUCH)
                put = foot_fitting.put(way, ankles[a:b, i], round(STANCE_S * FPS))
                shift[a:b] = put - ankles[a:b, i, :2]
            for (_, a), (b, _) in pairwise(stances):
                a, length = a - 1, b - a + 1
                for k in range(a + 1, b):
                    for axis in range(2):
                        values = shift[:, axis]
                        shift[k, axis] = foot_fitting.hermite(
                            values[a], values[a] - values[a - 1],
                            values[b], values[b + 1] - values[b], (k - a) / length, length,
                        )  # fmt: skip
            inner = slice(stances[0, 0], stances[-1, 1])
            moved = (got - ankles)[inner, i, :2]
            np.testing.assert_allclose(moved, shift[inner], atol=1e-5)

    def test_soles_stay_on_the_ground_and_none_is_below_it(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        composed = jumping(character, rng, 3)
        fitted = fit_feet(character, composed)
        bodies = [character.body(f"{side}_foot") for side in FEET]
        own, low = (
            clearances(character, character.kinematics(x))[:, bodies]
            for x in (composed.source, fitted)
        )
        assert low.min() > min(own.min(), 0.0) - 1e-6
        stands = composed.contacts
        assert np.all(low[stands] < own[stands] + 0.02)

    def test_case_1_and_2_keep_the_place_of_the_one_motion(self, character: Character) -> None:
        """A foot that stands before and in the first half, and one that does in the second."""
        motion = standing(character, 4.0, FPS)
        bent = crouched(character, motion.poses)
        moved = bent.copy()
        moved[:, 0] += 0.04
        jump, blend = 40, 30
        left = 1.0 - rotations.ease((np.arange(len(bent)) - jump) / blend)
        played = moved.copy()
        played[:, 0] -= 0.04 * left
        source = np.concatenate([bent[:jump], moved[jump:]])
        contacts = np.zeros((len(bent), 2), dtype=bool)
        contacts[:55, 0] = contacts[60:, 1] = True
        composed = ComposedMotion(played, source, contacts, [jump], FPS, blend / FPS)
        ankles, _ = foot_states(character, fit_feet(character, composed))
        before, after = (foot_states(character, x[:1])[0][0] for x in (bent, moved))
        np.testing.assert_allclose(ankles[:55, 0, :2], np.tile(before[0, :2], (55, 1)), atol=1e-6)
        np.testing.assert_allclose(
            ankles[60:, 1, :2], np.tile(after[1, :2], (len(bent) - 60, 1)), atol=1.5e-3
        )

    def test_case_4_stays_until_the_foot_is_lifted(self, character: Character) -> None:
        composed, before = standing_over(character, 0.04)
        ankles, _ = foot_states(character, fit_feet(character, composed))
        stands = np.flatnonzero(composed.contacts[:, 0])
        gone = ankles[stands, 0, :2] - before[0, :2]
        np.testing.assert_allclose(gone, 0.0, atol=1e-6)

    def test_a_stance_that_blends_drag_far_is_put_within_reach(self, character: Character) -> None:
        """It begins, and one blend after the other carries it on by half a step."""
        composed = dragged(character, 0.3)
        assert worst_slide(character, composed.poses, composed.contacts) > 5e-3
        fitted = fit_feet(character, composed)
        assert worst_slide(character, fitted, composed.contacts) < 1e-6
        ankles, _ = foot_states(character, fitted)
        away = np.abs(ankles - foot_states(character, composed.poses)[0])[:, 0, 0]
        stands = composed.contacts[:, 0]
        assert away[stands].max() < 0.25
        lowered = composed.poses[:, 2] - fitted[:, 2]
        assert lowered.max() < MAX_ROOT_DROP

    def test_a_foot_is_not_held_farther_away_than_allowed(
        self, character: Character, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        composed, _ = standing_over(character, 0.3)
        monkeypatch.setattr(foot_fitting_module, "MAX_HOLD_DISTANCE", 0.1)
        ankles, _ = foot_states(character, fit_feet(character, composed))
        played, _ = foot_states(character, composed.poses)
        away = np.linalg.norm((ankles - played)[..., :2], axis=-1)
        assert away.max() == pytest.approx(0.1, abs=1e-3)


class TestDiscs:
    """Places within reach of a leg, seen from above."""

    @given(seed=seeds, count=st.integers(1, 30))
    @settings(max_examples=40)
    def test_a_point_is_moved_into_them_or_between(self, seed: int, count: int) -> None:
        rng = np.random.default_rng(seed)
        along = np.linspace(-1.0, 1.0, count)[:, None]
        centres = along * rng.normal(scale=0.25, size=2) + rng.normal(scale=0.02, size=(count, 2))
        discs = np.column_stack([centres, rng.uniform(0.05, 0.5) + 0.02 * along])
        start = rng.normal(scale=0.2, size=2)
        x, y, inside = _into_discs(*start, discs)
        best = foot_fitting.least_outside(discs)
        out = foot_fitting.outside((x, y), discs)
        assert inside == (out <= 1e-4)
        assert out < (0.01 if best < 0.0 else best + 0.03)
        if foot_fitting.outside(start, discs) <= 0.0:
            assert (x, y) == tuple(start)


class TestTheRest:
    """What is not to change."""

    def test_feet_that_do_not_slide_stay_bit_for_bit(self, character: Character) -> None:
        motion = standing(character, 3.0, FPS)
        contacts = np.ones((len(motion), 2), dtype=bool)
        fitted = fit_feet(character, unjumped(replace(motion, contacts=contacts)))
        np.testing.assert_array_equal(fitted, motion.poses)

    def test_fitting_twice_is_fitting_once(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        motion = drifting(character, rng)
        once = fit_feet(character, unjumped(motion))
        twice = fit_feet(character, unjumped(replace(motion, poses=once)))
        same_poses(twice, once, 2e-4)

    def test_frames_well_before_the_jump_stay_bit_for_bit(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        motion = standing(character, 2.0, FPS)
        composed, _ = standing_over(character, 0.04)
        first = int(np.asarray(composed.jumps)[0])
        fitted = fit_feet(character, composed)
        np.testing.assert_array_equal(fitted[:first], composed.poses[:first])
        assert len(motion) > first

    def test_trunk_and_arms_are_as_played(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        composed = jumping(character, rng, 2)
        fitted = fit_feet(character, composed)
        upper = slice(3, 3 + 4 * 8)
        np.testing.assert_allclose(fitted[:, upper], composed.poses[:, upper], atol=1e-12)
        np.testing.assert_array_equal(fitted[:, :2], composed.poses[:, :2])

    @given(seed=seeds)
    @settings(max_examples=10)
    def test_mirrored_in_mirrored_out(self, seed: int) -> None:
        character = default_character()
        composed = jumping(character, np.random.default_rng(seed), 2)
        mirrored = replace(
            composed,
            poses=character.mirror(composed.poses),
            source=character.mirror(composed.source),
            contacts=composed.contacts[:, ::-1],
        )
        same_poses(
            fit_feet(character, mirrored), character.mirror(fit_feet(character, composed)), 1e-6
        )

    @given(seed=seeds)
    @settings(max_examples=10)
    def test_turned_in_turned_out(self, seed: int) -> None:
        character = default_character()
        rng = np.random.default_rng(seed)
        composed = jumping(character, rng, 2)
        yaw, place = rng.uniform(-3.0, 3.0), (*rng.normal(size=2), 0.0)

        def moved(poses: FloatArray) -> FloatArray:
            return Motion(poses, FPS).moved(yaw, place).poses

        turned = replace(composed, poses=moved(composed.poses), source=moved(composed.source))
        same_poses(fit_feet(character, turned), moved(fit_feet(character, composed)), 1e-6)

    def test_knees_keep_their_plane_and_nothing_snaps(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        composed = jumping(character, rng, 3)
        fitted = fit_feet(character, composed)
        for side in FEET:
            before, after = (
                [foot_fitting.knee_flexion(character, pose, side) for pose in poses]
                for poses in (composed.poses, fitted)
            )
            steps, own = np.abs(np.diff(after)), np.abs(np.diff(before))
            assert steps.max() < own.max() + 0.1
        lowered = composed.poses[:, 2] - fitted[:, 2]
        assert lowered.min() >= 0.0
        assert lowered.max() <= MAX_ROOT_DROP
        assert np.abs(np.diff(lowered)).max() < 0.01


class TestRequests:
    """What is refused."""

    @pytest.mark.parametrize(
        ("changed", "message"),
        [
            ({"source": np.zeros((4, 59))}, "source must have"),
            ({"contacts": np.zeros((5, 2), dtype=bool)}, "contacts must be"),
            ({"jumps": [3, 2]}, "ascending"),
            ({"jumps": [10_000]}, "jumps must be frames below"),
            ({"fps": 0.0}, "fps and blend_s"),
            ({"blend_s": -1.0}, "fps and blend_s"),
            ({"fitted": np.zeros((10_000, 59))}, "fitted must have at most"),
            ({"ground": np.zeros(3)}, "ground must be"),
        ],
    )
    def test_what_does_not_fit(
        self, character: Character, changed: dict[str, object], message: str
    ) -> None:
        composed = unjumped(walk(character, 1.0))
        wrong = replace(composed, **changed)  # type: ignore[arg-type]
        with pytest.raises(MotionError, match=message):
            fit_feet(character, wrong)

    def test_blends_before_the_first_frame_count(
        self, character: Character, rng: np.random.Generator
    ) -> None:
        """A piece that begins in a blend puts its first stance where the motion after has it."""
        composed = jumping(character, rng, 1)
        jump = int(np.asarray(composed.jumps)[0])
        late = replace(
            composed,
            poses=composed.poses[jump + 3 :],
            source=composed.source[jump + 3 :],
            contacts=composed.contacts[jump + 3 :],
            jumps=[-3],
        )
        fitted = fit_feet(character, late)
        assert worst_slide(character, fitted, late.contacts) < 1e-6
        ended = round(BLEND_S * FPS)
        off = np.abs(foot_states(character, fitted)[0] - foot_states(character, late.source)[0])[
            ended:
        ]
        assert off.max() < 0.05


@pytest.mark.mocap
class TestRealWalks:
    """Recorded steps."""

    @pytest.mark.parametrize("fps", [15.0, 30.0])
    @pytest.mark.parametrize("name", ["woddy2_walk_normal_left_45", "woddy2_walk_fast_stright"])
    def test_steps_slide_by_less_than_a_centimetre(
        self, character: Character, motions_folder: Path, name: str, fps: float
    ) -> None:
        file = motions_folder / "snumrl_DataDrivenBipedController" / f"{name}.bvh"
        motion = load_motion(file, options=LoadOptions(trim_t_poses=True)).resampled(fps)
        composed = ComposedMotion(motion.poses, motion.poses, motion.contacts, [], fps, BLEND_S)
        fitted = replace(motion, poses=fit_feet(character, composed))
        before, after = stance_slides(motion, character), stance_slides(fitted, character)
        assert np.median(before) > 0.01
        assert np.percentile(after, 99) < 0.01
        own, steps = joint_speeds(motion), joint_speeds(fitted)
        assert np.percentile(steps, 99.9) < 1.05 * np.percentile(own, 99.9)
        depth = -clearances(character, character.kinematics(fitted.poses)).min()
        assert depth < max(-clearances(character, character.kinematics(motion.poses)).min(), 0.011)


def joint_speeds(motion: Motion) -> FloatArray:
    """Changes of joint velocities from frame to frame [rad/s]."""
    return np.linalg.norm(
        np.diff(motion.velocities()[:, 6:].reshape(len(motion), 13, 3), axis=0), axis=-1
    )
