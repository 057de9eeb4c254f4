from pathlib import Path

import pytest

from dynresp.support import paths
from dynresp.support.errors import DynrespError, UsageError


def test_shipped_folders_are_found() -> None:
    assert (paths.reactions_folder() / "sources.csv").is_file()
    assert paths.models_folder().name == "models"
    assert (paths.example_specs("experiments") / "walk_ball.toml").is_file()


def test_checkout_has_the_folder_beside_the_package(tmp_path: Path) -> None:
    package = tmp_path / "dynresp"
    package.mkdir()
    (tmp_path / "models").mkdir()
    (tmp_path / "pyproject.toml").touch()
    assert paths.data_folder("models", package) == tmp_path / "models"


def test_plain_install_has_the_folder_inside_the_package(tmp_path: Path) -> None:
    package = tmp_path / "site-packages" / "dynresp"
    inside = package / "_data" / "reactions"
    inside.mkdir(parents=True)
    (tmp_path / "site-packages" / "reactions").mkdir()
    assert paths.data_folder("reactions", package) == inside


def test_somebody_elses_folder_in_site_packages_is_not_taken(tmp_path: Path) -> None:
    package = tmp_path / "site-packages" / "dynresp"
    package.mkdir(parents=True)
    (tmp_path / "site-packages" / "models").mkdir()
    with pytest.raises(DynrespError, match=r"'models' is missing.*_data.*install dynresp again"):
        paths.data_folder("models", package)


def test_cache_is_the_systems_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(paths.CACHE_VARIABLE, raising=False)
    default = paths.cache_folder()
    assert default.is_absolute()
    assert "dynresp" in default.parts
    monkeypatch.setenv(paths.CACHE_VARIABLE, "")
    assert paths.cache_folder() == default


def test_cache_override(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(paths.CACHE_VARIABLE, str(tmp_path / "not there yet"))
    assert paths.cache_folder() == tmp_path / "not there yet"
    assert not paths.cache_folder().exists()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(paths.CACHE_VARIABLE, "cache")
    assert paths.cache_folder() == tmp_path / "cache"
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv(paths.CACHE_VARIABLE, "~/c")
    assert paths.cache_folder() == tmp_path / "c"


def test_cache_that_is_a_file_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv(paths.CACHE_VARIABLE, str(tmp_path / "file"))
    with pytest.raises(UsageError, match=r"DYNRESP_CACHE is .* not a folder"):
        paths.cache_folder()


def test_home_folders_are_filled_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert paths.expanded("~/a", "--motions") == tmp_path / "a"
    assert paths.expanded(Path("a/~b"), "--motions") == Path("a/~b")
    with pytest.raises(
        UsageError, match=r"--motions: '~nobody\.here/a': '~nobody\.here' is nobody"
    ):
        paths.expanded("~nobody.here/a", "--motions")
    monkeypatch.setenv(paths.CACHE_VARIABLE, "~nobody.here/a")
    with pytest.raises(UsageError, match=paths.CACHE_VARIABLE):
        paths.cache_folder()
