"""Responses to hits: base motion, simulation, blend and reaction, each in its frames."""

import math

import numpy as np
import pytest

from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT, Character
from dynresp.motion.feet.foot_fitting import MAX_ROOT_DROP
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Ball, Impact
from dynresp.physics.scene import Scene
from dynresp.physics.simulation import Simulation
from dynresp.physics.trace import Setup, Trace
from dynresp.response.responder import Responder
from dynresp.response.response import CARRY_ON, Response, ResponseConfig
from dynresp.response.response_quality import measure
from dynresp.response.transition.transition import place_on
from dynresp.response.windows.windows import ReactionTrack
from tests.oracles import window_error
from tests.response.samples import bowing, same_poses, same_response, tiny_library


def _simulated(character: Character, base: Motion, response: Response) -> tuple[Simulation, Trace]:
    """The look-ahead of a response, simulated once more and alone."""
    config = ResponseConfig()
    scene = Scene(character, response.prepared.kind, config.physics)
    velocity = base.velocities()[response.start]
    setup = Setup(base.poses[response.start :], response.prepared, velocity)
    simulation = Simulation(scene, [setup], 1)
    return simulation, simulation.look_ahead(config.horizon_s)[0]


class TestAHit:
    """What is true for every response to a hit."""

    def test_frames_come_in_order(self, responses: list[Response]) -> None:
        for response in responses:
            assert response.contact is not None
            assert response.contact_frame is not None
            assert response.exit is not None
            assert response.end is not None
            assert response.diverged is None
            assert response.contact_frame == response.start + response.contact.frame
            assert response.start <= response.contact_frame < response.exit < response.end
            assert response.end < len(response.motion) - 2
            assert 3 <= response.exit - response.contact_frame <= 15
            assert response.end - response.exit == 10

    def test_motions_are_valid(self, responses: list[Response]) -> None:
        for response in responses:
            poses = response.motion.poses
            assert np.isfinite(poses).all()
            quaternions = poses[:, 3:].reshape(len(poses), 14, 4)
            np.testing.assert_allclose(np.linalg.norm(quaternions, axis=2), 1.0, atol=1e-9)
            assert np.sum(quaternions[1:] * quaternions[:-1], axis=-1).min() > 0.0
            # No joint jumps: half a turn in a frame would be 94 rad/s.
            steps = rotations.angle_between(quaternions[:-1], quaternions[1:])
            assert steps.max() < 1.5
            assert np.abs(np.diff(poses[:, ROOT], axis=0)).max() < 0.3
            assert response.motion.fps == 30.0

    def test_before_the_simulation_the_base_motion_plays(
        self, responses: list[Response], base: Motion
    ) -> None:
        for response in responses:
            start = response.start
            assert start > 0
            np.testing.assert_array_equal(response.motion.poses[:start], base.poses[:start])
            np.testing.assert_array_equal(response.motion.contacts[:start], base.contacts[:start])
            # The simulation begins where the base motion is.
            np.testing.assert_array_equal(response.motion.poses[start], base.poses[start])

    def test_the_simulation_plays_until_the_exit(
        self, character: Character, responses: list[Response], base: Motion
    ) -> None:
        for response in responses:
            assert response.exit is not None
            _, trace = _simulated(character, base, response)
            assert trace.contact == response.contact
            exit_frame = response.exit - response.start
            part = response.motion.poses[response.start : response.exit]
            same_poses(part, trace.poses[:exit_frame], 1e-12)
            if trace.impactor is not None:
                assert response.impactor is not None
                shown = response.impactor[response.start : response.exit + 1]
                np.testing.assert_array_equal(shown, trace.impactor[: exit_frame + 1])

    def test_the_blend_begins_where_the_simulation_is(
        self, character: Character, responses: list[Response], base: Motion
    ) -> None:
        """Except for what is raised out of the floor."""
        for response in responses:
            assert response.exit is not None
            _, trace = _simulated(character, base, response)
            left = trace.poses[response.exit - response.start]
            pose = response.motion.poses[response.exit]
            np.testing.assert_allclose(pose[:2], left[:2], atol=1e-9)
            assert -1e-9 <= pose[2] - left[2] < 0.02
            turned_by = rotations.angle_between(
                pose[3:].reshape(14, 4)[:9], left[3:].reshape(14, 4)[:9]
            )
            # Root, trunk and arms; the legs may be bent out of the floor.
            np.testing.assert_allclose(turned_by[:8], 0.0, atol=1e-9)

    def test_after_the_end_the_placed_reaction_plays(self, responses: list[Response]) -> None:
        for response in responses:
            assert response.end is not None
            assert response.entry is not None
            assert response.entered_motion is not None
            rest = response.motion.poses[response.end + 1 :]
            clip = response.entered_motion.poses[response.entry + 11 :][: len(rest)]
            placed = place_on(clip, 0, rest[0])
            _same_except_the_legs(rest, placed)

    def test_the_reaction_is_placed_at_the_exit(
        self, character: Character, responses: list[Response], base: Motion
    ) -> None:
        for response in responses:
            assert response.exit is not None
            assert response.entry is not None
            assert response.entered_motion is not None
            _, trace = _simulated(character, base, response)
            left = trace.poses[response.exit - response.start]
            placed = place_on(response.entered_motion.poses[response.entry :], 0, left)
            rest = response.motion.poses[response.exit + 11 :]
            _same_except_the_legs(rest, placed[11 : 11 + len(rest)])
            if response.choice == CARRY_ON:
                # From there on the base motion alone goes on.
                same_poses(rest[-1:], placed[[10 + len(rest)]], 1e-7)

    def test_the_choice_is_the_best_of_all(
        self,
        character: Character,
        library: ReactionLibrary,
        responder: Responder,
        responses: list[Response],
        base: Motion,
    ) -> None:
        """Against a search of all windows by the slow twin."""
        config = responder.config
        assert any(response.choice != CARRY_ON for response in responses)
        for response in responses:
            assert response.choice is not None
            assert set(response.errors) == {*(r.name for r in library.reactions), CARRY_ON}
            assert response.error == response.errors[response.choice]
            carry_on = response.errors[CARRY_ON]
            best = min(response.errors[r.name] for r in library.reactions)
            if response.choice != CARRY_ON:
                assert response.error == best
                assert carry_on > min(best, config.carry_on_max_error)
        response = next(response for response in responses if response.choice != CARRY_ON)
        assert response.contact is not None
        assert response.contact_frame is not None
        _, trace = _simulated(character, base, response)
        seen = character.kinematics(trace.poses[response.contact.frame :])
        tracks = []
        for reaction, windows in zip(
            library.reactions, responder.chooser.windows.windows, strict=True
        ):
            states = character.kinematics(reaction.motion.poses)
            bounds = (int(windows.starts[0]), int(windows.starts[-1]) + 1)
            # Enough of it follows for the blend, and to be seen.
            assert bounds[1] - 1 <= len(reaction.motion) - config.remaining_s * base.fps + 1e-6
            tracks.append(ReactionTrack(reaction.name, states.centers, states.quaternions, bounds))
        found = window_error.best_match((seen.centers, seen.quaternions), tracks, config.window)
        assert response.choice == tracks[found[3]].name
        assert response.error == pytest.approx(found[0], rel=1e-4)
        assert response.exit == response.contact_frame + found[1]
        assert response.entry == found[2]

    def test_a_choice_that_fits_is_found(
        self, character: Character, library: ReactionLibrary, base: Motion
    ) -> None:
        """A reaction made of the simulation itself is chosen, with hardly any mismatch."""
        plain = Responder(character, library, threads=1).respond([(base, Ball(1.0))])[0]
        _, trace = _simulated(character, base, plain)
        assert trace.contact is not None
        own = Motion(trace.poses[trace.contact.frame :], 30.0, "own")
        held = Motion(np.concatenate([own.poses, own.poses[[-1] * 30]]), 30.0, "own")
        turned_away = held.moved(2.0, (5.0, -3.0, 0.0))
        tiny = tiny_library(bowing=bowing(character), own=turned_away)
        response = Responder(character, tiny, threads=1).respond([(base, Ball(1.0))])[0]
        assert response.choice == "own"
        assert response.error == pytest.approx(0.0, abs=1e-3)
        assert response.entry == response.exit - response.contact_frame  # type: ignore[operator]

    def test_quality_is_measured(self, character: Character, responses: list[Response]) -> None:
        for response in responses:
            quality = measure(response, character)
            assert quality is not None
            assert all(math.isfinite(value) for value in vars(quality).values())


class TestTheSameBits:
    """One seed, one result: threads, other hits and order do not matter."""

    def test_on_any_number_of_threads(
        self,
        character: Character,
        library: ReactionLibrary,
        hits: list[tuple[Motion, Impact]],
        responses: list[Response],
    ) -> None:
        again = Responder(character, library, threads=2).respond(hits)
        for a, b in zip(responses, again, strict=True):
            same_response(a, b)

    def test_alone_or_backward(
        self, responder: Responder, hits: list[tuple[Motion, Impact]], responses: list[Response]
    ) -> None:
        for a, b in zip(responses, responder.respond(hits[::-1])[::-1], strict=True):
            same_response(a, b)
        same_response(responses[1], responder.respond([hits[1]])[0])

    def test_responses_come_in_the_order_of_the_hits(
        self, responses: list[Response], hits: list[tuple[Motion, Impact]]
    ) -> None:
        for response, (base, impact) in zip(responses, hits, strict=True):
            due = response.start / base.fps + response.prepared.due_s
            assert due == pytest.approx(impact.time)


def test_a_response_keeps_its_impact_and_is_read_only(responses: list[Response]) -> None:
    for response in responses:
        assert response.motion.poses.flags.writeable is False
        assert response.prepared.start == response.start


def test_facing_of_the_reaction_is_that_of_the_character(
    character: Character, responses: list[Response], base: Motion
) -> None:
    """Half-way through the blend it faces about where it faced at the exit."""
    for response in responses:
        assert response.exit is not None
        yaw = rotations.yaw_of(response.motion.poses[:, ROOT_QUAT])
        turn = yaw[response.exit + 5] - yaw[response.exit]
        assert abs(math.remainder(float(turn), 2.0 * math.pi)) < 1.0


def _same_except_the_legs(shown: FloatArray, placed: FloatArray) -> None:
    """Standing feet may be held where they are, and the root lowered so that they reach."""
    np.testing.assert_allclose(shown[:, :2], placed[:, :2], atol=1e-7)
    lowered = placed[:, 2] - shown[:, 2]
    assert lowered.min() > -1e-7
    assert lowered.max() <= MAX_ROOT_DROP + 1e-7
    ours, theirs = (x[:, 3:].reshape(len(x), 14, 4)[:, :8] for x in (shown, placed))
    np.testing.assert_allclose(rotations.angle_between(ours, theirs), 0.0, atol=1e-6)
