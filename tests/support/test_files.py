from __future__ import annotations

import os
from pathlib import Path

import pytest

from dynresp.support.errors import DynrespError
from dynresp.support.files import replacing


def test_whole_file_in_a_new_folder(tmp_path: Path) -> None:
    target = tmp_path / "a" / "b.txt"
    with replacing(target) as temporary:
        assert temporary.suffix == ".txt"
        temporary.write_text("new")
        assert not target.exists()
    assert target.read_text() == "new"
    assert [p.name for p in target.parent.iterdir()] == ["b.txt"]


def test_the_old_file_stays_when_writing_fails(tmp_path: Path) -> None:
    target = tmp_path / "b.txt"
    target.write_text("old")

    def fail() -> None:
        with replacing(target) as temporary:
            temporary.write_text("half")
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["b.txt"]


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DynrespError, match="cannot write"), replacing(tmp_path / "file" / "x"):
        pass


def test_a_full_disk_is_told(tmp_path: Path) -> None:
    with (
        pytest.raises(DynrespError, match=r"cannot write .*x: No space left"),
        replacing(tmp_path / "x"),
    ):
        raise OSError(28, "No space left on device")


def test_an_error_about_another_file_stays_what_it_is(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="other"), replacing(tmp_path / "x"):
        (tmp_path / "other").read_bytes()
    assert not list(tmp_path.iterdir())


def test_a_folder_of_that_name(tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    with pytest.raises(DynrespError, match="cannot write"), replacing(tmp_path / "x") as temporary:
        temporary.touch()
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


def test_a_pipe_stays_one(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DynrespError, match="a device or a pipe"), replacing(tmp_path / "pipe"):
        pass
    assert (tmp_path / "pipe").is_fifo()
