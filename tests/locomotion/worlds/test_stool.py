import numpy as np
import pytest
from scipy.ndimage import binary_dilation, binary_erosion

from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.worlds.obstacles import body_clearances
from dynresp.locomotion.worlds.stool import (
    SIDE_M,
    stool_contacts,
    stool_ground,
    stool_motions,
    stool_world,
)
from dynresp.locomotion.worlds.world_contacts import standing_soles
from dynresp.motion import rotations
from dynresp.motion.builtin import FLAT, PREFIX, load_builtin
from dynresp.motion.character import Character
from dynresp.motion.feet.skating import stance_slides
from dynresp.motion.motion import Motion


@pytest.fixture(scope="module")
def motions(character: Character) -> list[Motion]:
    return stool_motions(character)


def test_ground_is_the_stool_or_the_floor() -> None:
    half = 0.5 * SIDE_M
    at = [[0.0, 0.0], [half - 1e-6, -half + 1e-6], [half + 1e-3, 0.0], [2.0, 2.0]]
    np.testing.assert_allclose(stool_ground(at), [SIDE_M, SIDE_M, 0.0, 0.0])
    assert stool_ground(np.zeros((4, 3, 2))).shape == (4, 3)


def test_motions_are_one_turned_by_quarters(character: Character, motions: list[Motion]) -> None:
    assert len({motion.name for motion in motions}) == len(motions) == 4
    assert all(motion.name.startswith(PREFIX) for motion in motions)
    assert motions[0] is load_builtin("stool", character)
    x, y = motions[0].root_positions[:, :2].T
    np.testing.assert_allclose(motions[1].root_positions[:, :2], np.stack([-y, x], 1), atol=1e-9)
    assert sum(motion.duration for motion in motions) > 300.0


def test_feet_stand_on_the_stool_and_on_the_floor(
    character: Character, motions: list[Motion]
) -> None:
    for motion in motions:
        assert max(stance_slides(motion, character)) < 0.001
        soles = standing_soles(character, motion.poses, motion.contacts)
        middle, low = soles.mean(axis=2), soles[..., 2].min(axis=2)
        on_top = low > 0.5 * SIDE_M
        assert on_top.sum() > 500
        # A foot that leaves stands on its toes, and the sole's corners are a little higher.
        np.testing.assert_allclose(low[on_top], SIDE_M, atol=0.025)
        assert np.abs(middle[on_top][:, :2]).max() < 0.5 * SIDE_M
        below = ~on_top & np.isfinite(low)
        np.testing.assert_allclose(low[below], 0.0, atol=0.025)
        # Nobody stands in the stool.
        assert stool_world().distances(soles[below][..., :2]).min() > 0.0


def test_contacts_are_found_where_they_were_planned(
    character: Character, motions: list[Motion]
) -> None:
    motion = motions[1]
    found = stool_contacts(motion, character)
    # A foot that lands or leaves is fast for some frames, and one that turns about hardly rises.
    inner = binary_erosion(motion.contacts, np.ones((9, 1), dtype=bool), border_value=1)
    outer = binary_dilation(motion.contacts, np.ones((9, 1), dtype=bool))
    assert (found | ~inner).mean() > 0.99
    assert (~found | outer).mean() > 0.97


def test_nothing_is_in_the_stool(character: Character, motions: list[Motion]) -> None:
    clear = body_clearances(stool_world(), character, motions[0].poses[::3], max_distance=0.05)
    # Shanks touch its edges in the long step, and the body overlaps it a little in sitting.
    assert clear.min() > -0.045
    assert (clear < -0.012).mean() < 0.01


def test_all_labelled_actions_happen(motions: list[Motion]) -> None:
    motion = motions[0]
    done = {label.name.removesuffix(" mirrored") for label in motion.labels}
    assert done >= {"step_on", "cross", "return", "step_over", "jump_over", "jump_down", "sit"}
    assert [label.stop for label in motion.labels[:-1]] == [x.start for x in motion.labels[1:]]
    height = motion.root_positions[:, 2]
    away = np.linalg.norm(motion.root_positions[:, :2], axis=1)
    assert (height[away < 0.1] > SIDE_M + 0.9).any()  # stands on it
    seated = (away < 0.12) & (height < SIDE_M + 0.10)
    assert seated.sum() > 60
    aloft = ~motion.contacts.any(axis=1)
    assert np.count_nonzero(np.diff(aloft.astype(int)) == 1) == 2  # jumps over it, and down
    assert (aloft & (away < 0.15)).any()
    # It goes around the stool in both directions: all bearings, more than half a turn at once.
    bearing = np.unwrap(np.arctan2(*motion.root_positions[away > 1.0, 1::-1].T))
    assert np.ptp(bearing) > np.pi
    facing = np.unwrap(rotations.yaw_of(motion.root_quaternions))
    assert np.ptp(facing) > 2 * np.pi


def test_makes_one_graph_in_fixed_coordinates(character: Character, motions: list[Motion]) -> None:
    graph = MotionGraph.build(motions, GraphConfig(coordinates=Coordinates.FIXED), character)
    assert len(graph.frames) > 0.95 * len(graph.database.poses)


@pytest.mark.parametrize("mirrored", [False, True])
def test_walking_makes_one_graph_without_any_recording(
    character: Character, mirrored: bool
) -> None:
    flat = [load_builtin(name, character) for name in FLAT]
    assert sum(motion.duration for motion in flat) > 120.0
    graph = MotionGraph.build(flat, GraphConfig(mirrored=mirrored), character)
    assert len(graph.frames) > 0.95 * len(graph.database.poses)
