"""Built-in motions are made once and then read from the user's cache folder."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dynresp.motion.builtin.builtin_motions import builtin_folder
from dynresp.motion.builtin.motion_cache import kept_motion
from dynresp.motion.character import Character
from dynresp.motion.motion import Label, Motion
from dynresp.support.paths import CACHE_VARIABLE
from dynresp.support.progress import hearing

SPEC = builtin_folder() / "walk.toml"


@pytest.fixture
def making(character: Character) -> tuple[Callable[[], Motion], list[int]]:
    """What makes a motion, and how often it was called."""
    calls: list[int] = []

    def make() -> Motion:
        calls.append(1)
        poses = np.tile(character.rest_pose, (4, 1))
        poses[:, 0] = [0.1, 0.2, 1.0 / 3.0, np.pi]
        return Motion(poses, 30.0, "built-in: test", np.eye(4, 2, dtype=bool), (Label("a", 0, 4),))

    return make, calls


def test_the_second_is_read_with_the_same_bits(
    making: tuple[Callable[[], Motion], list[int]],
    character: Character,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    make, calls = making
    heard: list[str] = []
    with hearing(heard.append):
        first, second = (kept_motion(SPEC, character, make) for _ in range(2))
    assert len(calls) == len(heard) == 1
    assert first.poses.tobytes() == second.poses.tobytes()
    assert (first.fps, first.name, first.labels) == (second.fps, second.name, second.labels)
    np.testing.assert_array_equal(first.contacts, second.contacts)


def test_another_file_is_another_motion(
    making: tuple[Callable[[], Motion], list[int]],
    character: Character,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    make, calls = making
    spec = tmp_path / "walk.toml"
    for text in ("a = 1", "a = 2", "a = 2"):
        spec.write_text(text)
        kept_motion(spec, character, make)
    assert len(calls) == 2


def test_a_damaged_file_is_made_again(
    making: tuple[Callable[[], Motion], list[int]],
    character: Character,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    make, calls = making
    kept_motion(SPEC, character, make)
    (file,) = tmp_path.rglob("*.npz")
    file.write_bytes(file.read_bytes()[:100])
    kept_motion(SPEC, character, make)
    kept_motion(SPEC, character, make)
    assert len(calls) == 2


def test_no_place_for_a_cache_is_no_failure(
    making: tuple[Callable[[], Motion], list[int]],
    character: Character,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "file").write_text("")
    make, calls = making
    for place in ("file", "file/inside"):
        monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / place))
        kept_motion(SPEC, character, make)
    assert len(calls) == 2
