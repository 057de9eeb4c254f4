"""The entry back into a graph, against its slow twin and on made falls."""

import numpy as np
import pytest

from dynresp.locomotion.avatar import graph_entry
from dynresp.locomotion.avatar.graph_entry import ReentryPlanner
from dynresp.locomotion.avatar.pose_index import EntryIndex
from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT, Character
from dynresp.motion.feet import legs
from dynresp.motion.motion import Motion, interpolate, pose_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import MotionError
from tests.locomotion.graph.graph_samples import made_database, wandering_poses
from tests.locomotion.samples import walking_graph, walking_motions
from tests.oracles import reentry as oracle
from tests.oracles.motion_graph import distance

Moments = tuple[FloatArray, FloatArray, FloatArray]


def _graph(rng: np.random.Generator, coordinates: Coordinates) -> MotionGraph:
    config = GraphConfig(coordinates=coordinates, contact_change=False, sigma=1.0)
    return MotionGraph.from_database(made_database(rng, (60, 50, 40)), config)


def _moments(rng: np.random.Generator, graph: MotionGraph, count: int = 7) -> Moments:
    """Some like frames of the database, some like nothing."""
    near = rng.choice(len(graph.database), count)
    poses = graph.database.poses[near].copy()
    quaternions = poses[:, 3:].reshape(count, 14, 4)
    noise = rotations.from_rotation_vector(rng.normal(0.0, 0.05, (count, 14, 3)))
    poses[:, 3:] = rotations.multiply(quaternions, noise).reshape(count, -1)
    poses[:3] = wandering_poses(rng, 3, 0.8)
    velocities = graph.database.velocities[near] + rng.normal(0.0, 0.2, (count, 45))
    return poses, velocities, rng.random((count, 2)) < 0.5


@pytest.mark.parametrize("coordinates", list(Coordinates))
@pytest.mark.parametrize("max_distance", [np.inf, 0.4])
@pytest.mark.parametrize("seed", range(2))
def test_the_nearest_frames_are_those_of_the_slow_twin(
    character: Character, coordinates: Coordinates, max_distance: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    graph = _graph(rng, coordinates)
    index = EntryIndex(graph)
    poses, velocities, contacts = _moments(rng, graph)
    found = index.nearest(poses, velocities, contacts, max_distance)
    for row in range(len(poses)):
        expected = oracle.nearest(
            graph, character.joint_names, index.frames.tolist(),
            poses[row], velocities[row], contacts[row], max_distance,
        )  # fmt: skip
        if expected.distance > max_distance:
            assert found.distances[row] > max_distance
            continue
        assert found.frames[row] == expected.frame
        assert found.distances[row] == pytest.approx(expected.distance, abs=1e-9)
        assert found.same_contacts[row] == expected.same_contacts


@pytest.mark.parametrize("seed", range(2))
def test_moment_and_frame_are_found_together(
    character: Character, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(seed)
    graph = _graph(rng, Coordinates.RELATIVE)
    costs = oracle.Costs(max_distance=0.6, waiting=0.1, other_feet=0.3)
    monkeypatch.setattr(graph_entry, "MAX_DISTANCE", costs.max_distance)
    monkeypatch.setattr(graph_entry, "WAITING_COST", costs.waiting)
    monkeypatch.setattr(graph_entry, "OTHER_FEET_COST", costs.other_feet)
    monkeypatch.setattr(graph_entry, "FOOT_OFFSET_COST", 0.0)
    planner = ReentryPlanner(graph, character)
    poses, velocities, contacts = _moments(rng, graph)
    times = np.arange(len(poses)) / 5.0
    found = [
        oracle.nearest(
            graph, character.joint_names, planner.entries.frames.tolist(),
            poses[row], velocities[row], contacts[row], costs.max_distance,
        )
        for row in range(len(poses))
    ]  # fmt: skip
    entry = planner.find(poses, velocities, contacts, times)
    moment = oracle.left_at(found, times, costs)
    assert entry is not None
    assert moment is not None
    assert (entry.moment, entry.frame) == (moment, found[moment].frame)
    assert entry.distance == pytest.approx(found[moment].distance, abs=1e-9)
    assert entry.same_contacts == found[moment].same_contacts
    assert not len(entry.detour)


def _ankles(character: Character, poses: FloatArray) -> FloatArray:
    """(m, 2, 2) where ankles are on the ground, seen from the root and where it faces."""
    ankles = legs.ankle_positions(character, character.kinematics(poses))
    yaw = -rotations.yaw_of(poses[:, ROOT_QUAT])
    from_root = ankles - poses[:, None, ROOT]
    return rotations.rotate(rotations.from_yaw(yaw)[:, None], from_root)[..., :2]


@pytest.mark.parametrize("seed", range(2))
def test_the_distance_between_feet_counts(
    character: Character, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Moment and frame are the best of all candidates, compared one by one."""
    rng = np.random.default_rng(seed)
    graph = _graph(rng, Coordinates.RELATIVE)
    for name, value in (
        ("MAX_DISTANCE", 0.6),
        ("WAITING_COST", 0.1),
        ("FOOT_OFFSET_COST", 0.5),
        ("CANDIDATES", 150),
    ):
        monkeypatch.setattr(graph_entry, name, value)
    planner = ReentryPlanner(graph, character)
    poses, velocities, contacts = _moments(rng, graph)
    poses, velocities, contacts = (x[3:] for x in (poses, velocities, contacts))
    times = np.arange(len(poses)) / 5.0
    entry = planner.find(poses, velocities, contacts, times)
    assert entry is not None
    own, theirs = (_ankles(character, x) for x in (poses, graph.database.poses))
    costs = {}
    for moment in range(len(poses)):
        for frame in planner.entries.frames.tolist():
            if (graph.database.contacts[frame, :2] != contacts[moment]).any():
                continue
            moving = poses[moment], velocities[moment]
            recorded = graph.database.poses[frame], graph.database.velocities[frame]
            d = distance(moving, recorded, character.joint_names, graph.config)
            apart = np.linalg.norm(own[moment] - theirs[frame], axis=-1).max()
            costs[moment, frame] = d + 0.1 * times[moment] + 0.5 * apart
    assert entry.same_contacts
    assert (entry.moment, entry.frame) == min(costs, key=costs.__getitem__)
    monkeypatch.setattr(graph_entry, "FOOT_OFFSET_COST", 0.0)
    nearest = planner.find(poses, velocities, contacts, times)
    assert nearest is not None
    assert nearest.distance <= entry.distance + 0.1 * (len(poses) - 1) / 5.0


@pytest.mark.parametrize("count", [1, 5, 500])
def test_several_begin_with_the_nearest(character: Character, count: int) -> None:
    rng = np.random.default_rng(3)
    graph = _graph(rng, Coordinates.RELATIVE)
    index = EntryIndex(graph)
    moments = _moments(rng, graph)
    nearest, several = index.nearest(*moments), index.nearest_several(*moments, count)
    assert several.frames.shape == several.distances.shape == (len(moments[0]), count)
    np.testing.assert_array_equal(several.frames[:, 0], nearest.frames)
    assert (several.distances >= several.distances[:, :1] - 1e-12).all()
    for row in range(len(moments[0])):
        for column in (0, count // 2, count - 1):
            frame = int(several.frames[row, column])
            recorded = graph.database.poses[frame], graph.database.velocities[frame]
            pose = moments[0][row], moments[1][row]
            expected = distance(pose, recorded, character.joint_names, graph.config)
            assert several.distances[row, column] == pytest.approx(expected, abs=1e-9)


def test_every_entry_is_followed_by_a_frame_of_the_component(character: Character) -> None:
    graph = walking_graph(character)
    entries = ReentryPlanner(graph, character).entries.frames
    following = graph.database.successors[entries]
    assert np.isin(following, graph.frames).all()


def _down(character: Character, base: Motion, seconds: float = 1.0) -> Motion:
    """From the first pose of a motion down onto the back, in a straight line."""
    down = base.poses[0].copy()
    down[2] = 0.15
    down[ROOT_QUAT] = rotations.multiply(
        down[ROOT_QUAT], rotations.about_axis((0.0, 1.0, 0.0), -0.5 * np.pi)
    )
    frames = round(seconds * base.fps) + 1
    ends = (np.repeat(pose[None], frames, axis=0) for pose in (base.poses[0], down))
    return Motion(interpolate(*ends, np.linspace(0.0, 1.0, frames)), base.fps, "down")


def _find(planner: ReentryPlanner, motion: Motion):  # type: ignore[no-untyped-def]
    velocities = pose_velocities(motion.poses, motion.fps)
    times = np.arange(len(motion)) / motion.fps
    return planner.find(motion.poses, velocities, motion.contacts, times)


def test_who_ends_lying_has_no_way_back(character: Character) -> None:
    planner = ReentryPlanner(walking_graph(character), character)
    down = _down(character, walking_motions(character)[0].resampled(15.0))
    assert _find(planner, down) is None


def test_a_fall_is_not_left_before_it_is_over(character: Character) -> None:
    planner = ReentryPlanner(walking_graph(character), character)
    down = _down(character, walking_motions(character)[0].resampled(15.0))
    there_and_back = Motion(np.concatenate([down.poses, down.poses[::-1]]), down.fps)
    entry = _find(planner, there_and_back)
    assert entry is not None
    assert entry.moment > len(down)
    assert entry.distance < graph_entry.MAX_DISTANCE


@pytest.mark.parametrize("ends", ["where others walk", "in the air"])
def test_a_recording_of_getting_up_brings_back_who_lies(
    character: Character, ends: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    motions = walking_motions(character)
    walk = motions[0].resampled(15.0)
    down = _down(character, walk, 2.0)
    up = down.poses[::-1]
    if ends == "where others walk":
        up = np.concatenate([up, walk.poses[1:]])
    graph = MotionGraph.build([*motions, Motion(up, 15.0, "up")], GraphConfig(), character)
    planner = ReentryPlanner(graph, character)
    entry = _find(planner, down)
    assert entry is not None
    clip = graph.database.clips[-1]
    assert entry.moment == len(down) - 1
    assert entry.frame == clip.start
    assert entry.distance < 0.05
    # Through the recording frame by frame, then into the component.
    inside = np.isin(entry.detour, graph.frames)
    assert not inside[:-1].any()
    assert inside[-1]
    np.testing.assert_array_equal(
        entry.detour[:-1], clip.start + 1 + np.arange(len(entry.detour) - 1)
    )
    assert len(entry.detour) > 10
    monkeypatch.setattr(graph_entry, "MAX_LYING_DISTANCE", 0.0)
    assert _find(planner, down) is None


def test_an_index_needs_a_frame(character: Character) -> None:
    with pytest.raises(MotionError, match="at least one frame"):
        EntryIndex(walking_graph(character), [])
