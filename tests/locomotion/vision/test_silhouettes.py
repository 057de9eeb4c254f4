import numpy as np
import pytest

from dynresp.locomotion.vision.silhouettes import PIXEL, SIZE, Viewpoints, draw_silhouettes
from dynresp.motion.character import Character
from tests.motion.samples import random_poses
from tests.oracles.silhouettes import silhouette


def drawn(poses, character, views):
    return np.array([mask.copy() for _, _, mask in draw_silhouettes(poses, character, views)])


@pytest.mark.slow
def test_they_equal_those_of_the_slow_twin(character: Character, rng: np.random.Generator) -> None:
    poses = np.concatenate([character.rest_pose[None], random_poses(rng, 2)])
    views = Viewpoints(3, 0.3)
    right, up, _ = views.axes()
    masks = drawn(poses, character, views).reshape(3, 3, SIZE, SIZE)
    for frame in range(3):
        for view in range(3):
            expected = silhouette(poses[frame], character, right[view], up[view], SIZE, PIXEL)
            got = masks[frame, view] > 0
            # OpenCV fills the pixels on the edge as well: about a centimetre all around.
            union, common = (got | expected).sum(), (got & expected).sum()
            assert common >= 0.99 * expected.sum()
            assert common >= 0.75 * union


def test_a_standing_person_is_as_tall_as_the_character(character: Character) -> None:
    mask = drawn(character.rest_pose[None], character, Viewpoints(1, 0.0))[0]
    rows = np.flatnonzero(mask.any(axis=1))
    assert len(rows) * PIXEL == pytest.approx(1.74, abs=0.05)
    assert 0.3 < PIXEL * np.flatnonzero(mask.any(axis=0)).size < 0.7


def test_opposite_viewpoints_at_eye_level_are_mirror_images(
    character: Character, rng: np.random.Generator
) -> None:
    masks = drawn(random_poses(rng, 1), character, Viewpoints(4, 0.0))
    differing = np.count_nonzero(masks[0] != masks[2][:, ::-1])
    assert differing < 0.05 * np.count_nonzero(masks[0])


def test_order_and_axes(character: Character) -> None:
    order = [(f, v) for f, v, _ in draw_silhouettes(
        np.tile(character.rest_pose, (300, 1)), character, Viewpoints(2)
    )]  # fmt: skip
    assert order == [(f, v) for f in range(300) for v in range(2)]
    right, up, away = Viewpoints(4, 0.0).axes()
    np.testing.assert_allclose(away[0], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(right[0], [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(np.cross(right, away), up, atol=1e-12)
