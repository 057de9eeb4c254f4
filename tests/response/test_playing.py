"""The motion that a character plays changes at run time: in pieces, during a hit, after one."""

import functools
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest

from dynresp.motion.character import ROOT, Character
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.physics.impacts import Ball
from dynresp.response.runtime.dynamic_responder import EventKind, Phase
from dynresp.support.errors import MotionError, SpecError
from tests.physics.samples import walking
from tests.response.samples import FLUFF, WatchedCrowd

HARD = Ball(1.0, speed=12.0, mass=8.0)
MISS = Ball(0.5, speed=8.0, offset=4.0)


def _crowd(character: Character, library: ReactionLibrary, *bases: Motion) -> WatchedCrowd:
    return WatchedCrowd(character, library, bases, threads=1)


def _until(crowd: WatchedCrowd, phase: Phase) -> None:
    for _ in range(200):
        if crowd.responders[0].phase is phase:
            return
        crowd.advance()
    raise AssertionError(f"never {phase}")


def _steps(motion: Motion) -> float:
    """Longest step of the root between two frames [m]."""
    return float(np.linalg.norm(np.diff(motion.poses[:, ROOT], axis=0), axis=1).max())


@pytest.mark.parametrize("hit", [HARD, MISS, Ball(1.0, **FLUFF)])
def test_a_motion_given_in_pieces_plays_as_if_given_at_once(
    character: Character, library: ReactionLibrary, hit: Ball
) -> None:
    whole = walking(character, 20.0, yaw=0.4)
    crowds = [_crowd(character, library, whole), _crowd(character, library, whole.slice(0, 5))]
    ahead, piece = 150, 10
    for crowd in crowds:
        crowd.responders[0].hit(hit)
    fed = 5
    for frame in range(120):
        responder = crowds[1].responders[0]
        # Only until a choice: what follows it differs.
        while fed < frame + ahead and not any(event.choice for event in responder.events):
            responder.play(whole.slice(fed, fed + piece), responder.planned_until)
            fed += piece
        for crowd in crowds:
            crowd.advance()
    a, b = (crowd.shown().poses for crowd in crowds)
    np.testing.assert_allclose(a[:31], b[:31], atol=1e-9)
    first, second = (crowd.responders[0] for crowd in crowds)
    assert [event.kind for event in first.events] == [event.kind for event in second.events]
    names = [[e.choice.name for e in r.events if e.choice] for r in (first, second)]
    assert names[0] == names[1]
    np.testing.assert_allclose(a[-1], b[-1], atol=1e-3)


def _memory_of(work: Callable[[], object]) -> int:
    """Largest memory that a call needs [bytes]; it shows what is copied."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_and_the_cost_of_a_hit_do_not_grow_with_what_was_played(
    character: Character, library: ReactionLibrary
) -> None:
    whole = walking(character, 60.0)
    crowd = _crowd(character, library, whole.slice(0, 200))
    (responder,) = crowd.responders
    memory = []
    for lap in range(30):
        piece = whole.slice(200 + 40 * lap, 240 + 40 * lap)
        responder.play(piece, responder.planned_until)
        for _ in range(40):
            crowd.advance()
        hit = functools.partial(responder.hit, Ball(0.3, speed=10.0, offset=4.0))
        memory.append(_memory_of(hit))
        _until(crowd, Phase.APPROACH)
        assert responder.last_hit is not None
        assert len(responder.last_hit.base) < 200
        assert len(responder._timeline.pieces) < 10
    assert max(memory[-10:]) < 1.5 * max(memory[5:15])


def test_a_hit_costs_the_same_however_long_the_base_motion_is(
    character: Character, library: ReactionLibrary
) -> None:
    memory = []
    for length in (20.0, 1200.0):
        (responder,) = _crowd(character, library, walking(character, length)).responders
        hits = [functools.partial(responder.hit, Ball(1.0 + k)) for k in range(10)]
        memory.append(max(_memory_of(hit) for hit in hits))
    # A copy of the whole motion would be sixty times as much.
    assert memory[1] < 1.5 * memory[0]


def test_a_motion_given_during_the_approach_plays_after_a_miss(
    character: Character, library: ReactionLibrary
) -> None:
    base = walking(character, 6.0)
    crowd = _crowd(character, library, base)
    (responder,) = crowd.responders
    responder.hit(MISS)
    _until(crowd, Phase.APPROACH)
    first = responder.frame + 3
    turned = walking(character, 6.0, yaw=0.3)
    turned = turned.moved(0.0, base.poses[first, ROOT] - turned.poses[first, ROOT])
    responder.play(turned.slice(first, len(turned)), first)
    assert responder.last_hit is not None
    np.testing.assert_allclose(responder.last_hit.base.poses[4], turned.poses[first], atol=1e-12)
    for _ in range(40):
        crowd.advance()
    assert EventKind.MISSED in [event.kind for event in responder.events]
    np.testing.assert_allclose(responder.pose, turned.poses[responder.frame], atol=1e-12)
    assert _steps(crowd.shown()) < 0.1


def test_after_a_hit_without_reaction_the_motion_given_meanwhile_plays(
    character: Character, library: ReactionLibrary
) -> None:
    base = walking(character, 12.0)
    crowd = _crowd(character, library, base.slice(0, 90))
    (responder,) = crowd.responders
    responder.hit(Ball(1.0, **FLUFF))
    _until(crowd, Phase.APPROACH)
    responder.play(base.slice(90, 300), 90)
    for _ in range(200):
        crowd.advance()
    assert [e.choice.name for e in responder.events if e.choice] == ["carry_on"]
    # It walks on, beyond its first motion, from where it was after the hit.
    assert crowd.shown().poses[-1, 0] - crowd.shown().poses[100, 0] > 3.0
    assert _steps(crowd.shown()) < 0.1


def test_after_a_reaction_it_walks_on(character: Character, library: ReactionLibrary) -> None:
    crowd = _crowd(character, library, walking(character, 4.0))
    (responder,) = crowd.responders
    responder.hit(HARD)
    _until(crowd, Phase.PHYSICS)
    assert responder.free_from is None
    with pytest.raises(SpecError, match="before its blend has begun"):
        responder.play(walking(character, 1.0))
    _until(crowd, Phase.BLEND)
    free = responder.free_from
    assert free == responder.frame + 10
    with pytest.raises(SpecError, match=f"free from frame {free} on, got {free - 1}"):
        responder.play(walking(character, 1.0), free - 1)
    pose = responder.planned(free, 1)[0]
    on = walking(character, 3.0)
    on = on.placed(*pose[:2])
    responder.play(on)
    assert responder.planned_until == free + len(on)
    while responder.frame < free + 20:
        crowd.advance()
    np.testing.assert_allclose(responder.pose, on.poses[20], atol=1e-12)


def test_a_motion_of_another_rate_or_of_the_past_is_refused(
    character: Character, library: ReactionLibrary
) -> None:
    (responder,) = _crowd(character, library, walking(character, 2.0)).responders
    with pytest.raises(MotionError, match="has 60 fps"):
        responder.play(walking(character, 1.0, fps=60.0))
    with pytest.raises(SpecError, match="free from frame 1 on, got 0"):
        responder.play(walking(character, 1.0), 0)


def test_a_second_hit_during_the_blend_goes_on_with_a_moved_timeline(
    character: Character, library: ReactionLibrary
) -> None:
    crowd = _crowd(character, library, walking(character, 4.0))
    (responder,) = crowd.responders
    responder.hit(HARD)
    _until(crowd, Phase.BLEND)
    responder.hit(Ball(0.25, speed=10.0, offset=4.0))
    for _ in range(40):
        crowd.advance()
    assert EventKind.MISSED in [event.kind for event in responder.events]
    assert responder.phase is Phase.PLAYING
    assert _steps(crowd.shown()) < 0.2
