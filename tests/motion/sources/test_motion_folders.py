import os
from pathlib import Path

import pytest

from dynresp.motion.sources import motion_folders as sources
from dynresp.support.errors import SpecError, UsageError
from dynresp.support.paths import CACHE_VARIABLE


@pytest.fixture(autouse=True)
def _own_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv(sources.MOTIONS_VARIABLE, raising=False)
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))


def _folder(path: Path) -> Path:
    path.mkdir(parents=True)
    return path


def test_explicit_folder_comes_before_the_environment_and_the_cache(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert sources.motion_folders() == []
    cache = _folder(tmp_path / "cache" / "motions")
    assert sources.motion_folders() == [cache] == [sources.fetched_folder()]
    first, second = _folder(tmp_path / "first"), _folder(tmp_path / "second")
    monkeypatch.setenv(sources.MOTIONS_VARIABLE, f"{first}{os.pathsep}{os.pathsep}{second}")
    assert sources.motion_folders() == [first, second]
    explicit = _folder(tmp_path / "explicit")
    assert sources.motion_folders(explicit) == [explicit]


def test_empty_variable_counts_as_unset(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    cache = _folder(tmp_path / "cache" / "motions")
    monkeypatch.setenv(sources.MOTIONS_VARIABLE, "")
    assert sources.motion_folders() == [cache]


def test_home_folder_is_expanded(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    _folder(tmp_path / "mocap")
    assert sources.motion_folders(Path("~/mocap")) == [tmp_path / "mocap"]


def test_named_folder_that_is_not_there_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=r"--motions.*'.*nowhere' does not exist"):
        sources.motion_folders(tmp_path / "nowhere")
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match=r"--motions.*is a file"):
        sources.motion_folders(tmp_path / "file")
    monkeypatch.setenv(sources.MOTIONS_VARIABLE, str(tmp_path / "nowhere"))
    with pytest.raises(UsageError, match=r"DYNRESP_MOTIONS.*does not exist"):
        sources.motion_folders()


def test_first_folder_that_holds_the_file_wins(tmp_path: Path) -> None:
    one, two = _folder(tmp_path / "one" / "sub"), _folder(tmp_path / "two" / "sub")
    (two / "a.bvh").touch()
    folders = [one.parent, two.parent]
    assert sources.find_motion_file("sub/a.bvh", folders) == two / "a.bvh"
    (one / "a.bvh").touch()
    assert sources.find_motion_file("sub/a.bvh", folders) == one / "a.bvh"
    assert sources.find_motion_file("sub/b.bvh", folders) is None
    assert sources.find_motion_file("sub", folders) is None
    assert sources.find_motion_file("x" * 5000 + ".bvh", folders) is None


@pytest.mark.parametrize(
    "path",
    [
        "",
        "../secret.bvh",
        "a/../../secret.bvh",
        "a/..",
        "./a.bvh",
        "a//b.bvh",
        "/etc/passwd",
        "//host/share/a.bvh",
        "C:/a.bvh",
        "C:a.bvh",
        "..\\secret.bvh",
        "a\\b.bvh",
        "a\0.bvh",
        "a\n.bvh",
    ],
)
def test_paths_that_lead_out_of_the_folder_are_refused(path: str, tmp_path: Path) -> None:
    (tmp_path / "secret.bvh").touch()
    with pytest.raises(SpecError, match="not a path inside a motions folder"):
        sources.find_motion_file(path, [_folder(tmp_path / "motions")])


def test_listing_keeps_motion_files_only(tmp_path: Path) -> None:
    sub = _folder(tmp_path / "sub" / "deeper")
    _folder(tmp_path / ".hidden")
    for name in ("b.bvh", "A.BVH", "c.amc", "d.npz"):
        (sub / name).touch()
    (tmp_path / "deep.txt").write_text('{\n"Loop": "wrap",\n"Frames":\n[[0.1, 0]]}')
    (tmp_path / "deep.json").write_text('{"Frames": []}')
    (tmp_path / "skeleton.txt").write_text('{"Skeleton": {}}')
    (tmp_path / "notes.txt").write_text('the key "Frames" comes first')
    for name in ("c.asf", "e.bvh.part", ".f.bvh", ".hidden/g.bvh", "README.md"):
        (tmp_path / name).touch()
    (tmp_path / "folder.bvh").mkdir()
    listed = [path.relative_to(tmp_path).as_posix() for path in sources.list_motion_files(tmp_path)]
    deeper = [f"sub/deeper/{name}" for name in ("A.BVH", "b.bvh", "c.amc", "d.npz")]
    assert listed == ["deep.json", "deep.txt", *deeper]
    above = [path.name for path in sources.list_motion_files(tmp_path, levels=1)]
    assert above == ["deep.json", "deep.txt"]
    assert len(sources.list_motion_files(tmp_path, levels=2)) == 2
    assert len(sources.list_motion_files(tmp_path, levels=3)) == 6


@pytest.mark.parametrize(
    ("path", "pattern", "fits"),
    [
        ("a/b.bvh", "a/*.bvh", True),
        ("a/b.bvh", "*/b.[bc]vh", True),
        ("a/b.bvh", "*.bvh", False),
        ("a/c/b.bvh", "a/*.bvh", False),
        ("a/b.BVH", "a/*.bvh", False),
    ],
)
def test_wildcards_stand_for_no_slash(path: str, pattern: str, fits: bool) -> None:
    assert sources.fits_pattern(path, pattern) == fits


def test_listing_a_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="does not exist"):
        sources.list_motion_files(tmp_path / "nowhere")
