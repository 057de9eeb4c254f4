"""Hands that hold on to bars, in motions made for it and in the recorded ones."""

from pathlib import Path

import numpy as np
import pytest

from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.locomotion.playing.composition import Composition, compose
from dynresp.locomotion.worlds.playground import Bar, Playground, playground_contacts
from dynresp.locomotion.worlds.playground_fitting import (
    GRIP_M,
    REGRIP_S,
    compose_on_playground,
    find_holds,
    grips,
)
from dynresp.locomotion.worlds.world_contacts import palms
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.feet.skating import stance_slides
from dynresp.motion.load import LoadOptions, load_motion
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError

FPS = 30.0
FIXED = GraphConfig(coordinates=Coordinates.FIXED, contact_change=False, sigma=1.0)


def hanging(character: Character, seed: int, aside: float, lift: float = 0.0) -> FloatArray:
    """Poses (90, 59) of a body that hangs by bent arms and sways, shifted aside, then lets go."""
    rng = np.random.default_rng(seed)
    at = np.arange(90) / FPS
    poses = np.repeat(character.rest_pose[None], len(at), axis=0)
    poses[:, 1] += aside + 0.02 * np.sin(5.0 * at + rng.uniform(0, 6))
    poses[:, 2] += 1.0 + lift + 0.01 * np.sin(4.0 * at + rng.uniform(0, 6))
    let_go = rotations.ease((at - 2.2) / 0.4)
    for side in ("left", "right"):
        shoulder, elbow = (7 + 4 * character.joint(f"{side}_{x}") for x in ("shoulder", "elbow"))
        turn = -(2.9 - 1.5 * let_go)
        poses[:, shoulder : shoulder + 4] = rotations.about_axis((0.0, 1.0, 0.0), turn)
        poses[:, elbow : elbow + 4] = rotations.about_axis((0.0, -1.0, 0.0), 0.5)
    return poses


@pytest.fixture(scope="module")
def bars(character: Character) -> Playground:
    hands = palms(character, character.kinematics(hanging(character, 0, 0.0)))[0]
    x, _, z = hands.mean(axis=0)
    return Playground((Bar("high", (x, -1.0, z), (x, 1.0, z)),))


@pytest.fixture(scope="module")
def graph(character: Character, bars: Playground) -> MotionGraph:
    """Two clips that hang 12 cm apart: in a jump between them a hand slips unless it is fitted."""
    motions = [
        Motion(hanging(character, seed, 0.12 * seed), FPS, f"hanging {seed}") for seed in range(2)
    ]
    contacts = [playground_contacts(motion, character, bars) for motion in motions]
    return MotionGraph.build(motions, FIXED, character, contacts=contacts)


def over(graph: MotionGraph, character: Character, path: list[int]) -> Composition:
    return compose(graph, character, np.array(path, dtype=np.int32), fps=FPS)


def test_a_hand_that_holds_stays_where_it_holds(
    graph: MotionGraph, character: Character, bars: Playground
) -> None:
    first, second = graph.database.clips
    # From the first into the second and back: jumps as a graph takes them, while both hands hold.
    path = [
        *range(first.start, first.start + 12),
        *range(second.start + 12, second.start + 24),
        *range(first.start + 24, first.stop - 1),
    ]
    played = over(graph, character, path)
    holds = find_holds(graph, character, played, bars)
    assert sorted({hold.hand for hold in holds}) == [0, 1]
    assert all(hold.bar == 0 for hold in holds)
    loose = grips(character, played.motion, holds, bars)
    fitted = compose_on_playground(graph, character, path, FPS, bars)
    tight = grips(character, fitted.motion, holds, bars)
    assert loose.slip.max() > 0.04
    assert tight.slip.max() < 0.002
    reach = GRIP_M + bars.bars[0].radius
    assert tight.off_bar.max() < reach + 1e-3
    # The held point of the hand is at the held point of the bar in every frame.
    states = character.kinematics(fitted.motion.poses)
    for hold in holds:
        forearm = character.body(f"{('left', 'right')[hold.hand]}_forearm")
        rows = slice(hold.start, hold.stop)
        there = states.positions[rows, forearm] + rotations.rotate(
            states.quaternions[rows, forearm], hold.grip
        )
        assert np.abs(there - hold.place).max() < 1e-3
        assert bars.bars[hold.bar].distance(hold.place) < 1e-9
    assert (fitted.unfitted == played.unfitted).all()
    # No hand leaps where holds begin and end.
    before = character.kinematics(played.motion.poses)
    was, now = (np.abs(np.diff(palms(character, x), axis=0)).max() for x in (before, states))
    assert now < was + 0.02


def test_little_moves_where_nothing_slips(
    graph: MotionGraph, character: Character, bars: Playground
) -> None:
    clip = graph.database.clips[0]
    path = list(range(clip.start, clip.stop - 1))
    played = over(graph, character, path)
    fitted = compose_on_playground(graph, character, path, FPS, bars)
    moved = fitted.motion.poses[:, :3] - played.motion.poses[:, :3]
    assert np.abs(moved).max() < 0.06
    assert (fitted.motion.contacts == played.motion.contacts).all()


def test_a_hand_goes_from_bar_to_bar(
    graph: MotionGraph, character: Character, bars: Playground
) -> None:
    """Two bars end to end: each clip's hands hold their own, and let go in between."""
    (bar,) = bars.bars
    left_hand = palms(character, character.kinematics(graph.database.poses))[:, 0, 1]
    middle = float(np.mean(left_hand[graph.database.contacts[:, 2]]))
    (x, _, z) = bar.start
    two = Playground(
        (Bar("one", (x, -1.0, z), (x, middle, z)), Bar("other", (x, middle, z), (x, 1.0, z)))
    )
    first, second = graph.database.clips
    path = [*range(first.start, first.start + 16), *range(second.start + 16, second.start + 30)]
    played = over(graph, character, path)
    holds = [h for h in find_holds(graph, character, played, two) if h.hand == 0]
    assert [hold.bar for hold in holds] == [0, 1]
    assert holds[1].start - holds[0].stop == round(REGRIP_S * FPS)
    fitted = compose_on_playground(graph, character, path, FPS, two)
    assert grips(character, fitted.motion, holds, two).slip.max() < 0.002


def test_a_graph_without_hand_contacts_is_refused(graph: MotionGraph, character: Character) -> None:
    feet_alone = MotionGraph.build(
        [Motion(hanging(character, 0, 0.0), FPS, "hanging")], FIXED, character
    )
    path = feet_alone.frames[:10]
    with pytest.raises(UsageError, match="four columns of contacts"):
        compose_on_playground(feet_alone, character, path, FPS)


@pytest.mark.slow
@pytest.mark.mocap
def test_hands_of_recorded_climbers_hold_on(motions_folder: Path, character: Character) -> None:
    files = sorted((motions_folder / "cmu" / "01").glob("*.amc"))
    motions = [load_motion(file, options=LoadOptions(flat_floor=False)) for file in files]
    contacts = [playground_contacts(motion, character) for motion in motions]
    config = GraphConfig(
        coordinates=Coordinates.FIXED, contact_change=False, sigma=0.1, least_probability=0.05
    )
    graph = MotionGraph.build(motions, config, character, contacts=contacts)
    for seed in range(3):
        path = random_walk(graph, 1200, np.random.default_rng(seed))
        played = compose(graph, character, path, fps=FPS)
        fitted = compose_on_playground(graph, character, path, FPS)
        holds = find_holds(graph, character, played)
        assert len(holds) > 40
        loose, tight = (grips(character, x.motion, holds) for x in (played, fitted))
        assert np.median(loose.slip) > 0.04
        assert tight.slip.max() < 0.01
        assert tight.off_bar.max() < 0.06
        slides = (stance_slides(x.motion, character) for x in (played, fitted))
        before, after = (float(np.sum(x)) for x in slides)
        assert after < before + 0.02
        # Fitting does not make joints much faster.
        fast = [np.abs(x.motion.velocities()[:, 6:]) for x in (played, fitted)]
        assert np.percentile(fast[1], 99.9) < 1.1 * np.percentile(fast[0], 99.9)
