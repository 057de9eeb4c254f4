"""Characters at run time: events in their order, one continuous motion, second hits, misses."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.physics.impacts import Ball, Impact, Punch, Push, Strike
from dynresp.physics.simulation import Simulation
from dynresp.response.response import CARRY_ON, Response, ResponseConfig
from dynresp.response.runtime.dynamic_responder import DynamicResponder, EventKind, Phase
from dynresp.response.search.full_search_choice import FullSearchChooser
from dynresp.response.transition.transition import TransitionConfig
from dynresp.response.windows.window_config import WindowErrorConfig
from dynresp.support.errors import MotionError, SpecError, UsageError
from tests.physics.samples import punching, walking
from tests.response.samples import FLUFF, HITS, WatchedCrowd, tiny_library

HARD = Ball(1.0, speed=12.0, mass=8.0)


def _crowd(
    character: Character, library: ReactionLibrary, *bases: Motion, second_pass: bool = False
) -> WatchedCrowd:
    config = ResponseConfig(transition=TransitionConfig(second_pass=second_pass))
    return WatchedCrowd(character, library, bases, config, threads=1)


def _kinds(responder: DynamicResponder) -> list[EventKind]:
    return [event.kind for event in responder.events]


def _run_until(crowd: WatchedCrowd, phase: Phase, most: int = 200) -> None:
    for _ in range(most):
        if crowd.responders[0].phase is phase:
            return
        crowd.advance()
    raise AssertionError(f"never {phase}")


def _is_continuous(motion: Motion) -> None:
    """Neither joints nor root jump: a hit of that size moves them much less."""
    quaternions = motion.poses[:, 3:].reshape(len(motion), 14, 4)
    steps = rotations.angle_between(quaternions[:-1], quaternions[1:])
    assert steps.max() * motion.fps < 35.0
    assert np.linalg.norm(np.diff(motion.poses[:, :3], axis=0), axis=1).max() * motion.fps < 5.0


@pytest.mark.parametrize("which", range(len(HITS)))
def test_a_hit_gives_the_response_of_the_responder(
    character: Character,
    library: ReactionLibrary,
    base: Motion,
    responses: list[Response],
    which: int,
) -> None:
    expected = responses[which]
    crowd = _crowd(character, library, base)
    crowd.responders[0].hit(HITS[which])
    for _ in range(len(expected.motion) - 1):
        crowd.advance()
    shown = crowd.shown()
    # Without a reaction the base motion goes on longer here than in a response.
    length = min(len(shown), len(expected.motion))
    # The finished motion has its quaternions normalised once more.
    np.testing.assert_allclose(shown.poses[:length], expected.motion.poses[:length], atol=1e-12)
    chosen = [event for event in crowd.responders[0].events if event.kind is EventKind.CHOSEN]
    assert chosen[0].choice is not None
    assert chosen[0].choice.name == expected.choice
    frames = {event.kind: event.frame for event in crowd.responders[0].events}
    assert frames[EventKind.INVOKED] == expected.start
    assert frames[EventKind.CONTACT] == expected.contact_frame
    assert frames[EventKind.BLEND_BEGUN] == expected.exit
    assert frames[EventKind.BLEND_ENDED] == expected.end


def test_events_come_as_in_the_paper(
    character: Character, library: ReactionLibrary, base: Motion
) -> None:
    crowd = _crowd(character, library, base)
    crowd.responders[0].hit(HARD)
    for _ in range(100):
        crowd.advance()
    assert _kinds(crowd.responders[0]) == [
        EventKind.INVOKED,
        EventKind.CONTACT,
        EventKind.CHOSEN,
        EventKind.REWOUND,
        EventKind.BLEND_BEGUN,
        EventKind.BLEND_ENDED,
    ]
    frames = [event.frame for event in crowd.responders[0].events]
    assert frames == sorted(frames)


def test_a_second_pass_tracks_the_choice_from_the_contact_on(
    character: Character, library: ReactionLibrary, base: Motion
) -> None:
    shown = []
    for second_pass in (False, True):
        crowd = _crowd(character, library, base, second_pass=second_pass)
        crowd.responders[0].hit(HARD)
        for _ in range(80):
            crowd.advance()
        shown.append(crowd.shown().poses)
        contact = crowd.responders[0].events[1].frame
    np.testing.assert_array_equal(shown[0][: contact + 1], shown[1][: contact + 1])
    assert (
        np.abs(shown[0][contact + 2 : contact + 6] - shown[1][contact + 2 : contact + 6]).max() > 0
    )


def test_a_character_has_the_same_bits_in_a_crowd_as_alone(
    character: Character, library: ReactionLibrary, base: Motion
) -> None:
    other = walking(character, 5.0, speed=0.8, yaw=-2.0)
    bases = [base, other, base, other]
    hits: list[list[Impact]] = [
        [HARD],
        [Push(0.4), Ball(2.0, from_deg=90.0)],
        [Punch(1.1, target="chest"), Ball(1.9, offset=3.0)],
        [],
    ]
    together = _crowd(character, library, *bases)
    for responder, own in zip(together.responders, hits, strict=True):
        for hit in own:
            responder.hit(hit)
    alone = []
    for base_motion, own in zip(bases, hits, strict=True):
        crowd = _crowd(character, library, base_motion)
        for hit in own:
            crowd.responders[0].hit(hit)
        alone.append(crowd)
    for _ in range(110):
        poses = together.advance()
        for row, crowd in enumerate(alone):
            np.testing.assert_array_equal(crowd.advance()[0], poses[row])
    for responder, crowd in zip(together.responders, alone, strict=True):
        assert _kinds(responder) == _kinds(crowd.responders[0])


@pytest.mark.parametrize("phase", [Phase.PHYSICS, Phase.BLEND, Phase.PLAYING])
def test_a_second_hit_starts_from_the_present_pose(
    character: Character, library: ReactionLibrary, base: Motion, phase: Phase
) -> None:
    crowd = _crowd(character, library, base)
    responder = crowd.responders[0]
    responder.hit(HARD)
    _run_until(crowd, Phase.PHYSICS)
    _run_until(crowd, phase)
    before = responder.pose.copy()
    responder.hit(Push(0.0, 900.0, 0.2, from_deg=90.0))
    crowd.advance()
    assert responder.events[-4].kind is EventKind.INVOKED
    assert np.abs(responder.pose - before).max() < 0.2
    for _ in range(80):
        crowd.advance()
    assert _kinds(responder).count(EventKind.CHOSEN) == 2
    assert responder.phase is Phase.PLAYING
    _is_continuous(crowd.shown())


def test_a_second_ball_hits_a_character_in_the_blend(
    character: Character, library: ReactionLibrary, base: Motion
) -> None:
    crowd = _crowd(character, library, base)
    responder = crowd.responders[0]
    responder.hit(HARD)
    _run_until(crowd, Phase.BLEND)
    responder.hit(Ball(0.25, speed=9.0, from_deg=180.0))
    for _ in range(90):
        crowd.advance()
    assert _kinds(responder).count(EventKind.CONTACT) == 2
    _is_continuous(crowd.shown())


@pytest.mark.parametrize("when", ["playing", "in physics"])
def test_after_a_miss_it_goes_back_to_its_motion(
    character: Character, library: ReactionLibrary, base: Motion, when: str
) -> None:
    crowd = _crowd(character, library, base)
    responder = crowd.responders[0]
    if when == "in physics":
        responder.hit(HARD)
        _run_until(crowd, Phase.PHYSICS)
    responder.hit(Ball(0.3, speed=10.0, offset=4.0))
    for _ in range(60):
        crowd.advance()
    assert EventKind.MISSED in _kinds(responder)
    assert responder.phase is Phase.PLAYING
    _is_continuous(crowd.shown())
    if when == "playing":
        np.testing.assert_allclose(responder.pose, base.poses[60], atol=1e-12)


def test_a_light_hit_gets_no_reaction(
    character: Character, library: ReactionLibrary, base: Motion
) -> None:
    crowd = _crowd(character, library, base)
    crowd.responders[0].hit(Ball(1.0, **FLUFF))
    for _ in range(100):
        crowd.advance()
    choice = crowd.responders[0].events[2].choice
    assert choice is not None
    assert choice.name == CARRY_ON


def test_after_its_last_frame_a_motion_holds_and_can_be_hit(
    character: Character, library: ReactionLibrary
) -> None:
    crowd = _crowd(character, library, walking(character, 1.0))
    for _ in range(60):
        crowd.advance()
    crowd.responders[0].hit(HARD)
    for _ in range(60):
        crowd.advance()
    assert EventKind.CHOSEN in _kinds(crowd.responders[0])


def test_hits_that_cannot_come_are_refused(
    character: Character, library: ReactionLibrary, base: Motion
) -> None:
    crowd = _crowd(character, library, base)
    responder = crowd.responders[0]
    with pytest.raises(SpecError, match=r"due at 0\.05 s; .* from 0\.2"):
        responder.hit(Ball(0.05))
    for _ in range(10):
        crowd.advance()
    with pytest.raises(SpecError, match=r"due 0\.05 s from now and needs 0\.2[0-9] s to come"):
        responder.hit(Ball(0.05))
    responder.hit(Ball(1.0))
    with pytest.raises(SpecError, match=r"may hit until 1\.20 s from now"):
        responder.hit(Ball(1.1))
    responder.hit(Ball(1.6))
    # Also refused while the first is in the air.
    _run_until(crowd, Phase.APPROACH)
    for another in (Push(0.0), Ball(0.25)):
        with pytest.raises(SpecError, match="may hit until"):
            responder.hit(another)
    with pytest.raises(SpecError, match=r"at most 60 s from now, got 1e\+06"):
        responder.hit(Push(1e6))
    with pytest.raises(MotionError, match="at least one base motion"):
        _crowd(character, library)
    with pytest.raises(MotionError, match="has 60 fps"):
        _crowd(character, library, walking(character, 1.0, fps=60.0))


def test_a_chooser_made_with_other_settings_is_refused(
    character: Character, library: ReactionLibrary, base: Motion
) -> None:
    config = ResponseConfig(window=WindowErrorConfig(fps=30.0, exit_max_s=0.9))
    chooser = FullSearchChooser(character, library, config)
    with pytest.raises(UsageError, match="made with another config"):
        WatchedCrowd(character, library, [base], chooser=chooser)
    other = tiny_library(backing=walking(character, 1.5, speed=-1.0))
    other = replace(other, identity="other")
    with pytest.raises(UsageError, match="made with another library"):
        WatchedCrowd(character, other, [base], config, chooser)
    WatchedCrowd(character, library, [base], config, chooser)


def test_a_second_hit_begins_with_pose_and_velocity_of_the_first(
    character: Character, library: ReactionLibrary, base: Motion
) -> None:
    crowd = _crowd(character, library, base)
    (responder,) = crowd.responders
    responder.hit(HARD)
    _run_until(crowd, Phase.PHYSICS)
    crowd.advance()
    first = responder.last_hit
    assert first is not None
    assert first.trace is not None
    assert first.choice is not None
    now = responder.frame - first.start
    before, exit_frame = responder.pose, first.exit
    responder.hit(Push(0.0, 900.0, 0.2, from_deg=90.0))
    crowd.advance()
    second = responder.last_hit
    assert second is not None
    assert second is not first
    np.testing.assert_array_equal(second.setup.pose, before)
    np.testing.assert_array_equal(second.setup.velocity, first.trace.velocities[now])
    assert not second.setup.held
    # Without the second hit the choice of the first would go on, at its own time.
    entry = first.choice.entry - (exit_frame - (first.start + now))
    entered = first.choice.motion.poses[max(entry, 0)]
    np.testing.assert_allclose(second.base.poses[0, 7:], entered[7:], atol=1e-12)


def test_a_hit_while_playing_is_held_and_begins_with_the_motions_own_velocity(
    character: Character, library: ReactionLibrary, base: Motion
) -> None:
    crowd = _crowd(character, library, base)
    crowd.responders[0].hit(HARD)
    _run_until(crowd, Phase.APPROACH)
    hit = crowd.responders[0].last_hit
    assert hit is not None
    assert hit.setup.held
    np.testing.assert_allclose(hit.setup.velocity, base.velocities()[hit.start], atol=1e-12)


@pytest.mark.parametrize("phase", [Phase.APPROACH, Phase.PHYSICS])
@pytest.mark.parametrize("second_pass", [False, True])
def test_a_simulation_that_diverges_changes_no_other(
    character: Character,
    library: ReactionLibrary,
    base: Motion,
    monkeypatch: pytest.MonkeyPatch,
    phase: Phase,
    second_pass: bool,
) -> None:
    """The state is damaged during the approach, or before the rest is simulated."""
    crowd = _crowd(character, library, base, base, second_pass=second_pass)
    crowd.responders[0].hit(HARD)
    original = Simulation.approach if phase is Phase.APPROACH else Simulation.track

    def spoilt(self: Simulation, ids: Sequence[int], *rest: Any) -> None:
        if phase is Phase.PHYSICS or self.frame(ids[0]) == 3:
            self._batch.bind("qvel")[ids[0], :6] = 1e12
        original(self, ids, *rest)

    monkeypatch.setattr(Simulation, original.__name__, spoilt)
    for _ in range(80):
        crowd.advance()
    assert EventKind.DIVERGED in _kinds(crowd.responders[0])
    assert crowd.responders[0].phase is Phase.PLAYING
    assert np.isfinite(crowd.shown().poses).all()
    np.testing.assert_array_equal(crowd.shown(1).poses, base.poses[:81])
    # The next hit gets a response.
    monkeypatch.undo()
    crowd.responders[0].hit(Ball(0.4, speed=12.0, mass=8.0))
    for _ in range(40):
        crowd.advance()
    assert EventKind.CHOSEN in _kinds(crowd.responders[0])[-5:]


def test_a_strike_by_a_second_character(
    character: Character, library: ReactionLibrary, base: Motion
) -> None:
    crowd = _crowd(character, library, base)
    crowd.responders[0].hit(Strike(1.5, punching(character), 0.6, target="chest"))
    for _ in range(120):
        crowd.advance()
    assert EventKind.CHOSEN in _kinds(crowd.responders[0])
    _is_continuous(crowd.shown())


def test_a_character_can_be_hit_after_playing_for_long(
    character: Character, library: ReactionLibrary
) -> None:
    """The past is not prepared again: some minutes here, hours in a game."""
    crowd = _crowd(character, library, walking(character, 1.0))
    (responder,) = crowd.responders
    for _ in range(5_000):
        crowd.advance()
    responder.hit(HARD)
    _run_until(crowd, Phase.APPROACH)
    assert responder.last_hit is not None
    assert len(responder.last_hit.base) < 300
    for _ in range(40):
        crowd.advance()
    assert EventKind.CHOSEN in _kinds(responder)


def test_nothing_is_compiled_or_interpreted_in_a_frame(character: Character) -> None:
    from dynresp.motion.feet.foot_fitting_kernel import correct_kernel
    from dynresp.motion.feet.skating_kernel import slides_kernel
    from dynresp.response.prediction.hit_features_kernel import features_kernel

    walk = walking(character)
    _crowd(character, tiny_library(step=walk), walk)
    for kernel in (features_kernel, slides_kernel, correct_kernel):
        assert kernel._compiled is not None
