from pathlib import Path

import numpy as np
import pytest

from dynresp.locomotion.worlds.playground import (
    Bar,
    Playground,
    playground_contacts,
    recorded_playground,
)
from dynresp.locomotion.worlds.world_contacts import palms, sole_corners
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.load import LoadOptions, load_motion
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError

FPS = 30.0


def test_distance_from_a_bar() -> None:
    bar = Bar("bar", (0.0, 0.0, 1.0), (2.0, 0.0, 1.0))
    points = [[1.0, 0.3, 1.4], [-3.0, 0.0, 5.0], [2.0, 0.0, 1.0], [2.5, 0.0, 1.0]]
    assert bar.distance(points) == pytest.approx([0.5, 5.0, 0.0, 0.5])
    assert Bar("point", (1.0, 1.0, 1.0), (1.0, 1.0, 1.0)).distance([1.0, 1.0, 3.0]) == 2.0


def test_the_nearest_bar(rng: np.random.Generator) -> None:
    ends = rng.normal(size=(5, 2, 3))
    bars = tuple(Bar(f"bar {k}", tuple(a), tuple(b)) for k, (a, b) in enumerate(ends))
    points = rng.normal(size=(20, 3))
    index, distance = Playground(bars).nearest(points)
    shares = np.linspace(0.0, 1.0, 2001)[:, None]
    for point, i, d in zip(points, index, distance, strict=True):
        away = [np.linalg.norm(a + shares * (b - a) - point, axis=1).min() for a, b in ends]
        assert i == np.argmin(away)
        assert d == pytest.approx(min(away), abs=1e-3)


def test_wrong_bars_are_refused() -> None:
    bar = Bar("bar", (0.0, 0.0, 1.0), (1.0, 0.0, 1.0))
    with pytest.raises(UsageError, match="different name"):
        Playground((bar, bar))
    with pytest.raises(UsageError, match="start of bar 'bar' must be 3 finite numbers"):
        Playground((Bar("bar", (0.0, 0.0, np.nan), (1.0, 0.0, 1.0)),))
    with pytest.raises(UsageError, match="give it bars"):
        Playground(()).nearest(np.zeros(3))


def _hanging(character: Character, frames: int = 30) -> FloatArray:
    """Poses with both arms straight up, a metre above the ground."""
    poses = np.repeat(character.rest_pose[None], frames, axis=0)
    poses[:, 2] += 1.0
    for side in ("left", "right"):
        column = 7 + 4 * character.joint(f"{side}_shoulder")
        poses[:, column : column + 4] = rotations.about_axis((0.0, 1.0, 0.0), np.pi)
    return poses


def test_hands_hold_the_bar_that_they_hang_from(character: Character) -> None:
    poses = _hanging(character)
    left, right = palms(character, character.kinematics(poses))[0]
    aside = np.array([0.0, 0.3, 0.0])
    high = Playground((Bar("high", tuple(left + aside), tuple(right - aside)),))
    contacts = playground_contacts(Motion(poses, FPS), character, high)
    assert contacts.shape == (30, 4)
    assert (contacts == (False, False, True, True)).all()
    # A bar that is too short for the right hand, and one that the body falls past.
    short = Playground((Bar("short", tuple(left), tuple(left + aside)),))
    contacts = playground_contacts(Motion(poses, FPS), character, short)
    assert (contacts == (False, False, True, False)).all()
    falling = poses.copy()
    falling[:, 2] -= np.arange(30) * 2.0 / FPS
    contacts = playground_contacts(Motion(falling, FPS), character, high)
    assert not contacts[:, 2:].any()


def test_feet_stand_on_rungs_and_on_the_ground(character: Character) -> None:
    poses = np.repeat(character.rest_pose[None], 30, axis=0)
    nothing = Playground(())
    assert (playground_contacts(Motion(poses, FPS), character, nothing) == (1, 1, 0, 0)).all()
    poses[:, 2] += 0.5
    assert not playground_contacts(Motion(poses, FPS), character, nothing).any()
    soles = sole_corners(character, character.kinematics(poses)).mean(axis=2)[0]
    x, _, z = soles.mean(axis=0)
    rung = Playground((Bar("rung", (x, -0.5, z - 0.02), (x, 0.5, z - 0.02)),))
    assert (playground_contacts(Motion(poses, FPS), character, rung) == (1, 1, 0, 0)).all()


@pytest.mark.slow
@pytest.mark.mocap
def test_a_body_off_the_ground_holds_on(motions_folder: Path, character: Character) -> None:
    files = sorted((motions_folder / "cmu" / "01").glob("*.amc"))
    up = held = 0
    grips: dict[str, set[str]] = {}
    playground = recorded_playground()
    for file in files:
        motion = load_motion(file, options=LoadOptions(flat_floor=False)).resampled(30.0)
        contacts = playground_contacts(motion, character)
        states = character.kinematics(motion.poses)
        soles = sole_corners(character, states).mean(axis=2)
        if file.stem == "01_01":
            # Walking and hopping, without a hand on anything.
            assert contacts[:, 2:].mean() < 0.05
            continue
        off = (soles[..., 2] > 0.12).all(axis=1)
        up += np.count_nonzero(off)
        held += np.count_nonzero(off & contacts.any(axis=1))
        nearest, _ = playground.nearest(palms(character, states))
        for index in np.unique(nearest[contacts[:, 2:]]):
            grips.setdefault(playground.bars[index].name, set()).add(file.stem)
    assert up > 4000
    assert held > 0.95 * up
    # The clips share a world: the same bars are held in clip after clip.
    for name, clips in (("overhead ladder, rung 1", 5), ("south ladder, top", 6), ("high bar", 3)):
        assert len(grips[name]) >= clips
