import numpy as np
import pytest

from dynresp.locomotion.vision import segmentation
from dynresp.locomotion.vision.segmentation import Segmenter
from dynresp.motion.motion import Motion
from dynresp.support.errors import MotionError
from studies.video.filming import Filming, film
from tests.locomotion.vision.samples import stepping, waving
from tests.locomotion.vision.video_samples import person


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.logical_and(a, b).sum() / np.logical_or(a, b).sum())


@pytest.mark.parametrize(("seed", "who"), [(1, "02"), (2, "127"), (3, "17")])
def test_a_person_in_a_room_with_moving_light_is_found(seed, who, tmp_path) -> None:
    actor = person(who, tmp_path)
    act = stepping if seed == 1 else waving
    motion = Motion(act(actor, 120, 30.0), 30.0)
    masks: list[np.ndarray] = []
    segmenter = Segmenter(30.0)
    found = [segmenter.segment(p) for p in film(motion, actor, Filming(seed), masks)]
    assert all(mask is None for mask in found[:30])
    overlaps = [overlap(a > 0, b > 0) for a, b in zip(found[32:], masks[32:], strict=True)]
    assert np.mean(overlaps) > 0.8
    assert np.min(overlaps) > 0.6


@pytest.mark.slow
def test_a_person_who_stands_still_does_not_fade(tmp_path) -> None:
    actor = person("16", tmp_path)
    motion = Motion(np.tile(actor.rest_pose, (300, 1)), 10.0)
    masks: list[np.ndarray] = []
    segmenter = Segmenter(10.0)
    filming = Filming(5, fps=10.0)
    found = [segmenter.segment(p) for p in film(motion, actor, filming, masks)]
    assert overlap(found[-1] > 0, masks[-1] > 0) > 0.75


def test_an_empty_room_is_empty_even_when_it_gets_dark(rng) -> None:
    room = rng.uniform(60, 200, (90, 120, 3))
    segmenter = Segmenter(10.0)
    for k in range(60):
        light = 1.0 if k < 10 else 1.0 - 0.4 * (k - 10) / 50
        picture = room * light + rng.normal(0.0, 3.0, room.shape)
        assert segmenter.segment(np.clip(picture, 0, 255).astype(np.uint8)) is None


def test_large_pictures_are_shrunk_and_their_size_must_stay(monkeypatch) -> None:
    monkeypatch.setattr(segmentation, "LONGEST_SIDE", 64)
    segmenter = Segmenter(2.0)
    grey = np.full((300, 200, 3), 90, dtype=np.uint8)
    segmenter.segment(grey)
    segmenter.segment(grey)
    with_block = grey.copy()
    with_block[100:200, 50:120] = 250
    assert segmenter.segment(with_block).shape == (64, 43)
    with pytest.raises(MotionError, match="one size"):
        segmenter.segment(grey[:200])


@pytest.mark.parametrize(
    "wrong", [np.zeros((9, 9)), np.zeros((9, 9, 3)), np.zeros((0, 9, 3), dtype=np.uint8), "room"]
)
def test_what_is_not_a_picture_is_refused(wrong) -> None:
    with pytest.raises(MotionError, match="picture must be"):
        Segmenter(30.0).segment(wrong)
