"""Avatars that walk by graph, are hit, and walk on."""

import numpy as np
import numpy.typing as npt
import pytest

from dynresp.locomotion.avatar.avatar import Activity, Avatar
from dynresp.locomotion.avatar.avatar_crowd import AvatarCrowd
from dynresp.locomotion.graph.graph_config import GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT, Character
from dynresp.motion.feet.skating import foot_slides
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import BUILTIN, ReactionLibrary, load_library
from dynresp.motion.retargeting.floor import raise_above
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Ball, Impact, Push
from dynresp.response.runtime.dynamic_responder import EventKind, Phase
from dynresp.support.errors import UsageError
from tests.locomotion.avatar.avatar_samples import Watched, root_steps
from tests.locomotion.samples import walking_graph
from tests.physics.samples import walking
from tests.response.samples import FLUFF, tiny_library

FPS = 30.0
# Columns of waist and back in a pose.
UPPER = slice(7, 15)
HARD = Ball(0.5, speed=12.0, mass=8.0)


class Straight:
    """Goes on with the recording as long as there is one, and remembers what it was asked."""

    def __init__(self, graph: MotionGraph) -> None:
        self.graph = graph
        self.asked: list[int] = []

    def next_frames(self, frame: int, placement: FloatArray, count: int) -> npt.NDArray[np.int32]:
        self.asked.append(frame)
        path = []
        for _ in range(count):
            frame = int(self.graph.targets[self.graph.offsets[frame]])
            path.append(frame)
        return np.array(path, np.int32)


@pytest.fixture(scope="module")
def graph(character: Character) -> MotionGraph:
    return walking_graph(character)


@pytest.fixture(scope="module")
def library(character: Character) -> ReactionLibrary:
    """Some built-in reactions, which end standing."""
    every = load_library(BUILTIN, character=character)
    names = ("step_backward_small", "multiple_steps_forward", "upper_body_front", "upper_body_side")
    return tiny_library(**{name: every.reaction(name).motion for name in names})


@pytest.fixture
def one(character: Character, library: ReactionLibrary, graph: MotionGraph) -> Watched:
    return Watched(character, library, graph, [3])


def _turns(poses: FloatArray) -> FloatArray:
    """How fast joints turn, at most, from each frame to the next [rad/s]."""
    q = poses[:, 3:].reshape(len(poses), 14, 4)
    return np.asarray(rotations.angle_between(q[:-1], q[1:]).max(axis=1) * FPS)


def _returned(avatar: Avatar) -> int:
    """The frame at which the last reaction was left."""
    last = avatar.returns[-1]
    assert last.entry is not None
    assert last.moment is not None
    return last.moment


def test_it_walks_on_and_on_as_recorded(one: Watched, graph: MotionGraph) -> None:
    one.go_on(600)
    shown = one.shown()
    fastest = np.linalg.norm(graph.database.velocities[:, :3], axis=1).max() / FPS
    assert root_steps(shown).max() < 1.1 * fastest
    assert root_steps(shown).mean() > 0.5 * np.median(root_steps(shown)) > 0.005
    assert np.isfinite(shown).all()
    assert set(one.activity()) == {Activity.WALKING}
    # Arms and trunk are not touched by fitting feet: outside of blends they are as recorded.
    recorded = graph.database.poses[:, UPPER]
    apart = [np.abs(recorded - pose[UPPER]).max(axis=1).min() for pose in shown[::2]]
    assert np.median(apart) < 0.02


def test_it_begins_where_it_was_put_and_moves_as_recorded(
    character: Character, library: ReactionLibrary, graph: MotionGraph
) -> None:
    start = int(graph.frames[20])
    place = np.array([3.0, -2.0, 0.0, 1.0])
    crowd = AvatarCrowd(character, library, graph, [Straight(graph)], [(start, place)], threads=1)
    (avatar,) = crowd.avatars
    first = avatar.responder.pose
    shown = [crowd.advance()[0] for _ in range(4)]
    moved = rotations.rotate(
        rotations.from_yaw(1.0),
        graph.database.poses[start + 2, ROOT] - graph.database.poses[start, ROOT],
    )
    np.testing.assert_allclose(shown[3][ROOT] - first[ROOT], moved, atol=0.02)
    np.testing.assert_allclose(
        rotations.yaw_of(first[ROOT_QUAT]) - graph.database.planar[start, 3], 1.0, atol=1e-9
    )


def test_feet_stand_still_while_it_walks(
    one: Watched, graph: MotionGraph, character: Character
) -> None:
    one.go_on(450)
    shown = one.shown()[30:]
    slides = foot_slides(character, character.kinematics(shown))
    soles = character.kinematics(shown).positions[:, character.body("left_foot"), 2]
    standing = soles[:-1] < np.quantile(soles, 0.3)
    assert np.median(slides[standing, 0]) < 0.002


@pytest.mark.parametrize("impact", [HARD, Push(0.3, 900.0, 0.2, from_deg=180.0)])
def test_after_a_hit_it_walks_by_graph_again(
    one: Watched, graph: MotionGraph, impact: Impact
) -> None:
    (avatar,) = one.avatars
    one.go_on(60)
    avatar.responder.hit(impact)
    one.until(Phase.PHYSICS)
    one.go_on(1)
    assert avatar.activity is Activity.HIT
    one.until(Phase.PLAYING)
    assert avatar.activity is Activity.WALKING
    one.go_on(150)
    assert len(avatar.returns) == 1
    moment = _returned(avatar)
    contact = next(e.frame for e in avatar.responder.events if e.kind is EventKind.CONTACT)
    assert contact < moment < contact + 90
    shown = one.shown()
    after = shown[moment : moment + 60]
    fastest = np.linalg.norm(graph.database.velocities[:, :3], axis=1).max() / FPS
    assert root_steps(after).max() < 1.5 * fastest
    assert _turns(after).max() < 15.0
    # A second after the blend it walks as recorded.
    pose = shown[moment + 45, UPPER]
    apart = np.abs(graph.database.poses[:, UPPER] - pose).max(axis=1)
    assert apart.min() < 0.05


def test_after_a_miss_it_goes_on_as_if_nothing_had_been(
    character: Character, library: ReactionLibrary, graph: MotionGraph
) -> None:
    crowds = [Watched(character, library, graph, [3]) for _ in range(2)]
    crowds[0].avatars[0].responder.hit(Ball(1.0, speed=8.0, offset=4.0))
    for crowd in crowds:
        crowd.go_on(120)
    kinds = [event.kind for event in crowds[0].avatars[0].responder.events]
    assert EventKind.MISSED in kinds
    assert not crowds[0].avatars[0].returns
    a, b = (crowd.shown() for crowd in crowds)
    np.testing.assert_allclose(a[60:], b[60:], atol=1e-9)


def test_a_light_hit_is_carried_on_through_and_the_way_goes_on(
    one: Watched, graph: MotionGraph
) -> None:
    one.go_on(30)
    one.avatars[0].responder.hit(Ball(0.5, **FLUFF))
    one.go_on(200)
    (back,) = one.avatars[0].returns
    assert back.reaction == "carry_on"
    assert back.entry is not None
    # It resembles itself.
    assert back.entry.distance < 0.1
    assert root_steps(one.shown()).max() < 0.06


@pytest.mark.parametrize("phase", [Phase.APPROACH, Phase.PHYSICS, Phase.BLEND])
@pytest.mark.parametrize("second", [Push(0.0, 900.0, 0.2, 90.0), Ball(0.3, offset=4.0)])
def test_a_second_hit_at_any_time_is_survived(one: Watched, phase: Phase, second: Impact) -> None:
    (avatar,) = one.avatars
    one.go_on(20)
    avatar.responder.hit(HARD)
    one.until(Phase.APPROACH)
    if phase is not Phase.APPROACH:
        one.until(phase)
        avatar.responder.hit(second)
    one.go_on(240)
    assert avatar.activity is Activity.WALKING
    assert _returned(avatar) < avatar.responder.frame
    assert root_steps(one.shown()).max() < 0.17
    assert root_steps(one.shown()[-60:]).max() > 0.005


def test_it_is_the_same_with_any_number_of_threads_and_neighbours(
    character: Character, library: ReactionLibrary, graph: MotionGraph
) -> None:
    seeds = [3, 4, 5]
    crowds = [Watched(character, library, graph, seeds, threads) for threads in (1, 2)]
    alone = [Watched(character, library, graph, [seed]) for seed in seeds]
    for crowd in [*crowds, *alone]:
        for k, avatar in enumerate(crowd.avatars):
            own = k if len(crowd.avatars) > 1 else alone.index(crowd)
            avatar.responder.hit(Ball(1.0 + 0.1 * own, speed=9.0, from_deg=120.0 * own))
        crowd.go_on(150)
    for k in range(3):
        np.testing.assert_array_equal(crowds[0].shown(k), crowds[1].shown(k))
        np.testing.assert_array_equal(crowds[0].shown(k), alone[k].shown(0))


def test_it_is_steered_at_once(one: Watched, graph: MotionGraph) -> None:
    (avatar,) = one.avatars
    one.go_on(50)
    planner = Straight(graph)
    avatar.steer(planner)
    assert len(planner.asked) >= 1
    # The frame from which it goes on is due within two frames of the graph's.
    first = planner.asked[0]
    now = one.shown()[-1]
    near = np.abs(graph.database.poses[first, UPPER] - now[UPPER]).max()
    assert near < 0.3
    one.go_on(120)
    assert root_steps(one.shown()).max() < 0.06
    assert len(planner.asked) > 3


def test_who_is_steered_while_hit_goes_there_after_the_return(
    one: Watched, graph: MotionGraph
) -> None:
    (avatar,) = one.avatars
    one.go_on(20)
    avatar.responder.hit(HARD)
    one.until(Phase.PHYSICS)
    one.go_on(1)
    planner = Straight(graph)
    avatar.steer(planner)
    assert not planner.asked
    one.until(Phase.PLAYING)
    back = avatar.returns[-1].entry
    assert back is not None
    # First what was recorded there goes on, for as long as the reaction is blended away.
    blend = round(graph.config.blend_s * graph.database.fps)
    recorded = [back.frame]
    while len(recorded) <= blend and graph.targets[graph.offsets[recorded[-1]]] == recorded[-1] + 1:
        recorded.append(recorded[-1] + 1)
    assert planner.asked[0] == recorded[-1] > back.frame


def _falling(character: Character) -> Motion:
    """Falls on the back and stays there."""
    poses = np.repeat(walking(character, 0.1).poses[:1], 45, axis=0)
    part = np.minimum(np.arange(45) / 20.0, 1.0)
    poses[:, 2] += part * (0.15 - poses[0, 2])
    poses[:, ROOT_QUAT] = rotations.about_axis((0.0, 1.0, 0.0), -0.5 * np.pi * part)
    return Motion(raise_above(character, poses, FPS), FPS, "falling")


def test_who_falls_stays_down_and_can_be_hit_there(
    character: Character, graph: MotionGraph
) -> None:
    one = Watched(character, tiny_library(falling=_falling(character)), graph, [3])
    (avatar,) = one.avatars
    avatar.responder.hit(HARD)
    one.go_on(150)
    assert avatar.activity is Activity.STAYING
    assert avatar.returns[-1].entry is None
    assert avatar.responder.pose[2] < 0.3
    avatar.responder.hit(Push(0.1, 400.0, 0.2, target="pelvis"))
    one.go_on(100)
    assert avatar.activity is Activity.STAYING
    assert len(avatar.returns) == 2
    assert np.isfinite(one.shown()).all()


def test_who_falls_gets_up_by_a_recording_and_walks_on(
    character: Character, graph: MotionGraph
) -> None:
    falling = _falling(character)
    up = Motion(falling.poses[::-1], FPS, "up")
    motions = [graph.database.motion(clip) for clip in range(len(graph.database.clips))]
    with_up = MotionGraph.build([*motions, up], GraphConfig(), character)
    one = Watched(character, tiny_library(falling=falling), with_up, [3])
    (avatar,) = one.avatars
    avatar.responder.hit(HARD)
    one.go_on(60)
    back = avatar.returns[-1].entry
    assert back is not None
    assert len(back.detour) > 5
    one.go_on(200)
    assert one.shown()[:, 2].min() < 0.4
    assert avatar.responder.pose[2] > 0.8
    assert avatar.activity is Activity.WALKING
    assert root_steps(one.shown()).max() < 0.1


def test_what_does_not_fit_is_refused(
    character: Character, library: ReactionLibrary, graph: MotionGraph
) -> None:
    planner, place = Straight(graph), np.zeros(4)
    inside = int(graph.frames[0])
    outside = int(np.flatnonzero(np.diff(graph.offsets) == 0)[0])
    with pytest.raises(UsageError, match="not in the graph's component"):
        AvatarCrowd(character, library, graph, [planner], [(outside, place)])
    with pytest.raises(UsageError, match="2 starts and 1 planners"):
        AvatarCrowd(character, library, graph, [planner], [(inside, place)] * 2)
    fast = walking_graph(character, fps=60.0)
    with pytest.raises(UsageError, match="the graph has 60 fps, the simulation 30"):
        AvatarCrowd(character, library, fast, [Straight(fast)], [(int(fast.frames[0]), place)])
