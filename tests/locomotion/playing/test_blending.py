import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.placement import place_poses
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.locomotion.playing.blending import Playback
from dynresp.motion.character import Character, default_character
from dynresp.motion.motion import pose_velocities
from dynresp.motion.rotations import angle_between
from dynresp.support.errors import MotionError
from tests.locomotion.samples import walking_graph
from tests.oracles import playback as oracle


@pytest.fixture(scope="module")
def graph() -> MotionGraph:
    return walking_graph(default_character(), sigma=0.3)


def differences(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    turns = angle_between(a[:, 3:].reshape(-1, 14, 4), b[:, 3:].reshape(-1, 14, 4))
    return float(np.abs(a[:, :3] - b[:, :3]).max()), float(turns.max())


def test_agrees_with_the_slow_twin(graph: MotionGraph) -> None:
    walk = random_walk(graph, 200, np.random.default_rng(3))
    played = Playback(graph, int(walk[0])).play(walk[1:])
    assert played.jumps.sum() > 10
    slow, moving = oracle.play(graph, int(walk[0]), walk[1:].tolist())
    # The twin's velocities are differences, and so is what it blends.
    np.testing.assert_allclose(played.velocities, moving, atol=1e-5)
    shift, turn = differences(played.poses, slow)
    assert shift < 1e-6
    assert turn < 1e-6


def test_any_pose_and_velocity_are_met_where_a_blend_begins(
    graph: MotionGraph, rng: np.random.Generator
) -> None:
    """However far off: the velocity by differences of what is displaced."""
    frame = int(graph.frames[7])
    recorded, its = graph.database.poses[frame], graph.database.velocities[frame]
    off = np.concatenate([rng.normal(scale=0.3, size=3), rng.normal(scale=0.8, size=42)])
    pose = oracle.displaced(recorded, Rotation.from_euler("z", 2.0), np.array([3.0, 1, 0]), off)
    velocity = rng.normal(scale=2.0, size=45)
    playback = Playback.entering(graph, frame, pose, velocity)
    assert playback.displacement.shape == (91,)
    offset, rate, age = np.split(playback.displacement, [45, 90])
    x, y, z, yaw = playback.placement
    turn, shift = Rotation.from_euler("z", yaw), np.array([x, y, z])
    shown = oracle.displaced(recorded, turn, shift, offset)
    apart = differences(shown[None], pose[None])
    assert max(apart) < 1e-7
    moving = oracle.speed(recorded, its, turn, shift, offset, rate)
    np.testing.assert_allclose(moving, velocity, atol=1e-5)
    assert age == 0.0


def test_pieces_are_the_whole(graph: MotionGraph) -> None:
    walk = random_walk(graph, 300, np.random.default_rng(4))
    whole = Playback(graph, int(walk[0])).play(walk[1:]).poses
    playback = Playback(graph, int(walk[0]))
    pieces = [playback.play(part).poses for part in np.array_split(walk[1:], 23)]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)


def test_recorded_frames_are_played_as_they_are(graph: MotionGraph) -> None:
    clip = graph.database.clips[1]
    frames = np.arange(clip.start + 1, clip.stop)
    played = Playback(graph, clip.start).play(frames)
    assert not played.jumps.any()
    shift, turn = differences(played.poses, graph.database.poses[frames])
    assert shift < 1e-12
    assert turn < 1e-7


def test_a_jump_begins_at_the_pose_and_speed_before_it(graph: MotionGraph) -> None:
    """One frame before the target, displaced, is the frame left: a leap of zero length."""
    jump = int(np.flatnonzero(graph.database.successors[graph.sources] != graph.targets)[0])
    left, entered = int(graph.sources[jump]), int(graph.targets[jump])
    pose, velocity = graph.database.poses[left], graph.database.velocities[left]
    playback = Playback.entering(graph, entered - 1, pose, velocity)
    after = playback.play([entered]).poses[0]
    by_jump = Playback(graph, left).play([entered]).poses[0]
    shift, turn = differences(after[None], by_jump[None])
    assert shift < 1e-9
    assert turn < 1e-7


def test_any_pose_can_be_gone_on_from(
    graph: MotionGraph, character: Character, rng: np.random.Generator
) -> None:
    pose = character.rest_pose.copy()
    pose[:3] += [3.0, -2.0, 0.05]
    frame = int(graph.frames[5])
    playback = Playback.entering(graph, frame, pose, np.zeros(45))
    frames = random_walk(graph, 60, rng, frame)
    played = playback.play(frames)
    near, _ = differences(played.poses[:1], pose[None])
    assert near < 0.15
    speeds = np.abs(pose_velocities(np.concatenate([pose[None], played.poses]), 15.0)[:, :3])
    assert speeds.max() < 3.0


def test_no_jump_leads_to_the_beginning_of_a_clip(graph: MotionGraph) -> None:
    first = graph.database.clips[2].start
    with pytest.raises(MotionError, match="first of its clip"):
        Playback(graph, 3).play([first])
    with pytest.raises(MotionError, match="first of its clip"):
        Playback(graph, 3).play([0])


def test_placements_say_where_the_recorded_pose_was_put(character: Character) -> None:
    graph = walking_graph(character, sigma=0.3, blend_s=0.15, blend_rate_s=0.15)
    walk = random_walk(graph, 400, np.random.default_rng(5))
    played = Playback(graph, int(walk[0])).play(walk[1:])
    jumps = np.flatnonzero(played.jumps)
    calm = [k for k in range(len(walk) - 1) if not ((jumps <= k) & (jumps > k - 3)).any()]
    placed = place_poses(graph.database.poses[played.frames], played.placements)
    shift, turn = differences(placed[calm], played.poses[calm])
    assert len(calm) > 100
    assert shift < 1e-9
    assert turn < 1e-7
