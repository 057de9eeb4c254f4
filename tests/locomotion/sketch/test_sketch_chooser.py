import numpy as np
import pytest

from dynresp.locomotion.graph import placement
from dynresp.locomotion.playing.blending import Playback
from dynresp.locomotion.sketch.sketch_chooser import SketchChooser
from dynresp.motion.character import Character
from dynresp.support.errors import UsageError
from tests.locomotion.clusters.forest_samples import random_forest
from tests.oracles import warping as oracle


def center(character: Character, pose: np.ndarray) -> np.ndarray:
    centers = character.kinematics(pose).centers[0]
    return (character.masses @ centers / character.masses.sum())[:2]


@pytest.mark.parametrize("seed", range(10))
def test_the_action_whose_path_is_nearest_is_chosen(seed: int, character: Character) -> None:
    rng = np.random.default_rng(seed)
    forest = random_forest(rng, (9, 8), 8)
    graph = forest.graph
    frame, placed = int(rng.choice(graph.frames)), np.array([1.0, -2.0, 0.0, 0.7])
    root = placement.compose(placed, graph.database.planar[frame])[:2]
    sketch = root + np.linspace(0.0, 0.5, 6)[:, None] * [0.6, 0.8]
    action = SketchChooser(forest, character, 1.5, 0.5).choose(frame, placed, sketch)

    def center_path(frames: np.ndarray) -> np.ndarray:
        """The centre of mass of recorded poses, placed."""
        placements = Playback(graph, frame, placed).play(frames).placements
        poses = placement.place_poses(graph.database.poses[frames], placements)
        return np.array([center(character, pose) for pose in poses])

    np.testing.assert_allclose(action.path, center_path(action.frames), atol=1e-9)
    assert oracle.warp(sketch, action.path, True)[0] == pytest.approx(action.cost)
    # Every leaf, in the time that is left after the frames to the first branch.
    lead = forest.frames_to_branch(frame)
    left = forest.steps_within(1.5) - len(lead) + 1
    tree = forest.tree(frame, left / 15.0)
    costs = []
    for leaf in tree.leaves:
        motion = forest.likeliest_motion(tree, int(leaf), left / 15.0)
        frames = np.concatenate([lead, forest.stay(motion.frames, left)[1:]])[1:]
        if len(frames):
            costs.append(oracle.warp(sketch, center_path(frames), True)[0])
    assert action.cost == pytest.approx(min(costs))
    assert action.actions == len(costs)


def test_wrong_requests_are_refused(character: Character) -> None:
    forest = random_forest(np.random.default_rng(2))
    with pytest.raises(UsageError, match=r"above 0, got 0\.0 and 1\.0"):
        SketchChooser(forest, character, 0.0, 1.0)
    frame = int(forest.graph.frames[0])
    with pytest.raises(UsageError, match="look farther ahead"):
        SketchChooser(forest, character, 0.01).choose(frame, np.zeros(4), [(0, 0), (1, 0)])
    with pytest.raises(UsageError, match="the sketch is 1e\\+09 m long; at most 1000 m"):
        SketchChooser(forest, character).choose(frame, np.zeros(4), [(0, 0), (1e9, 0)])
    with pytest.raises(UsageError, match="component"):
        SketchChooser(forest, character).choose(-1, np.zeros(4), [(0, 0), (1, 0)])
