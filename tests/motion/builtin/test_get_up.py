"""Getting up after a fall: built-in motions from the front and from the side."""

from pathlib import Path

import numpy as np
import pytest

from dynresp.locomotion.avatar.graph_entry import ReentryPlanner
from dynresp.locomotion.graph.graph_config import GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion import ground, rotations
from dynresp.motion.builtin import FLAT, builtin_folder, builtin_info, load_builtin
from dynresp.motion.builtin.hands import hand_tip, hand_tracks
from dynresp.motion.builtin.keypose_spec import read_spec
from dynresp.motion.character import Character
from dynresp.motion.feet.skating import stance_slides
from dynresp.motion.motion import FEET, Motion
from dynresp.support.errors import SpecError

NAMES = ("get_up_prone", "get_up_side")


@pytest.mark.parametrize("name", NAMES)
def test_it_begins_on_the_ground_and_ends_standing(name: str, character: Character) -> None:
    assert builtin_info(name).kind == "get_up"
    motion = load_builtin(name)
    heights = motion.root_positions[:, 2]
    assert heights[0] < 0.2
    assert heights[-1] == pytest.approx(0.92, abs=0.01)
    assert motion.contacts[-1].all()
    assert np.abs(motion.velocities()[-3:]).max() < 0.1
    facing = rotations.rotate(motion.root_quaternions[[0, -1]], np.array([1.0, 0.0, 0.0]))
    left = rotations.rotate(motion.root_quaternions[0], np.array([0.0, 1.0, 0.0]))
    if name == "get_up_prone":
        assert facing[0, 2] < -0.99
    else:
        assert left[2] < -0.95
    assert facing[-1, 0] > 0.99


@pytest.mark.parametrize("name", NAMES)
def test_something_rests_on_the_ground_and_nothing_sinks_in(
    name: str, character: Character
) -> None:
    motion = load_builtin(name)
    lowest = ground.clearances(character, character.kinematics(motion.poses)).min(axis=1)
    assert lowest.min() > -0.005
    assert lowest.max() < 0.005
    velocity = np.gradient(motion.root_positions, 1.0 / motion.fps, axis=0)
    push = np.gradient(velocity, 1.0 / motion.fps, axis=0)[2:-2]
    assert np.linalg.norm(push, axis=1).max() < 9.81
    assert np.abs(motion.velocities()[:, 6:]).max() < 12.0


@pytest.mark.parametrize("name", NAMES)
def test_hands_feet_and_the_kneeling_knee_stay(name: str, character: Character) -> None:
    motion = load_builtin(name)
    assert max(stance_slides(motion, character)) < 1e-3
    states = character.kinematics(motion.poses)
    spec = read_spec(builtin_folder() / f"{name}.toml")
    times = np.arange(len(motion)) / motion.fps
    for side, track in zip(FEET, hand_tracks(spec.prop, character, times), strict=True):
        point, radius = hand_tip(character, side)
        forearm = character.body(f"{side}_forearm")
        tips = states.positions[:, forearm] + rotations.rotate(
            states.quaternions[:, forearm], point
        )
        props = track.weights == 1.0
        assert np.count_nonzero(props) > 30
        assert np.abs(tips[props] - track.tips[props]).max() < 1e-3
        assert track.tips[props, 2] == pytest.approx(radius)
    # The left knee bears him from all fours until he stands up over the right foot.
    knee = states.positions[:, character.body("left_shank")]
    begin = next(stance.start for stance in spec.stance if stance.foot == "left") + 0.3
    kneels = (times >= begin) & (times <= spec.lying[0].stop - spec.lying[0].ease)
    assert np.count_nonzero(kneels) > 30
    assert np.ptp(knee[kneels, :2], axis=0).max() < 0.05


def test_whoever_has_fallen_gets_up_by_graph(character: Character) -> None:
    ups = [load_builtin(name) for name in NAMES]
    walking = [load_builtin(name) for name in FLAT]
    graph = MotionGraph.build([*walking, *ups], GraphConfig(mirrored=True), character)
    bare = MotionGraph.build(walking, GraphConfig(mirrored=True), character)
    # They lead into the graph, and nothing leads to them.
    assert graph.counts.component == bare.counts.component
    planner, without = ReentryPlanner(graph, character), ReentryPlanner(bare, character)
    falls = [load_builtin("side_fall"), load_builtin("side_fall").mirrored(character)]
    lies = ups[0].slice(0, 2).poses
    prone = Motion(np.repeat(lies[:1], 60, axis=0), 30.0, "lies face down")
    for fallen in (*falls, prone, prone.mirrored(character)):
        last = slice(len(fallen) - 1, None)
        given = (
            fallen.poses[last], fallen.velocities()[last], fallen.contacts[last], np.zeros(1),
        )  # fmt: skip
        assert without.find(*given) is None
        way = planner.find(*given)
        assert way is not None
        assert way.distance < 0.5
        assert len(way.detour) > 30
        names = {graph.database.clips[clip].name for clip in graph.database.clip_of[way.detour]}
        assert any("getting up" in name for name in names)
        assert np.isin(way.detour[-1], graph.frames)


def test_wrong_props_are_refused(tmp_path: Path) -> None:
    text = (builtin_folder() / "get_up_prone.toml").read_text()
    for old, new, message in (
        ('hand = "left"', 'hand = "both"', "prop 1.hand"),
        ("at = [0.27, 0.30]", "at = [0.27]", "prop 1.at"),
        ("to = 1.66", "to = 9.0", "left hand: 'to' is 9 s"),
    ):
        file = tmp_path / "wrong.toml"
        file.write_text(text.replace(old, new, 1))
        with pytest.raises(SpecError, match=message):
            read_spec(file)
