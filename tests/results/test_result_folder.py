from pathlib import Path

import pytest

from dynresp.results import result_folder as folder
from dynresp.support.errors import DynrespError
from dynresp.view.video_writer import RenderingUnavailableError

RESPONSE = ("result.json", "motion.npz", "motion.bvh", "recording.html", "filmstrip.png",
            "alignment.png", "video.mp4")  # fmt: skip


def fill(where: Path, *names: str) -> None:
    where.mkdir(parents=True, exist_ok=True)
    for name in names:
        (where / name).touch()


def there(where: Path) -> list[str]:
    return sorted(path.relative_to(where).as_posix() for path in where.rglob("*"))


def test_a_batch_keeps_its_own_and_what_is_not_dynresps(tmp_path: Path) -> None:
    fill(tmp_path, *RESPONSE, "summary.json", "table.csv", "notes.txt", "my.npz")
    fill(tmp_path / "hit_00003", *RESPONSE)
    fill(tmp_path / "hit_00004", *RESPONSE)
    fill(tmp_path / "hit_00005", *RESPONSE, "notes.txt")
    fill(tmp_path / "hit_5", "result.json")
    assert folder.clear_batch(tmp_path, [3, 12345]) == {}
    kept = ["hit_00003", *(f"hit_00003/{name}" for name in RESPONSE), "hit_00005",
            "hit_00005/notes.txt", "hit_5", "hit_5/result.json", "my.npz", "notes.txt",
            "summary.json", "table.csv"]  # fmt: skip
    assert there(tmp_path) == sorted(kept)


def test_a_response_keeps_what_it_wrote(tmp_path: Path) -> None:
    fill(tmp_path, *RESPONSE, "summary.json", "table.csv", "notes.txt")
    fill(tmp_path / "hit_00004", *RESPONSE)
    assert folder.clear_response(tmp_path, ["result.json", "motion.npz"]) == {}
    assert there(tmp_path) == ["motion.npz", "notes.txt", "result.json"]


def test_links_and_folders_of_those_names_are_left_alone(tmp_path: Path) -> None:
    fill(tmp_path / "elsewhere", *RESPONSE)
    out = tmp_path / "out"
    (out / "video.mp4").mkdir(parents=True)
    (out / "hit_00001").symlink_to(tmp_path / "elsewhere")
    assert folder.clear_response(out, []) == {}
    assert folder.clear_batch(out, []) == {}
    assert (out / "video.mp4").is_dir()
    assert len(there(tmp_path / "elsewhere")) == len(RESPONSE)


def test_what_cannot_be_removed_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unlink(path: Path, missing_ok: bool = False) -> None:
        raise PermissionError(13, "Permission denied")

    fill(tmp_path / "hit_00001")
    monkeypatch.setattr(Path, "unlink", unlink)
    failed = folder.clear_batch(tmp_path, [])
    there = {*RESPONSE, folder.PLAN, folder.OPTIONS, folder.WATCHING}
    assert set(failed) == {*there, *(f"hit_00001/{name}" for name in there)}
    assert folder.is_failure(failed["result.json"])
    assert "Permission denied" in failed["result.json"]


@pytest.mark.parametrize(
    ("error", "message", "failure"),
    [
        (None, "written", False),
        (RenderingUnavailableError("no GL"), "not written: no GL", False),
        (folder.NothingToShowError("a miss"), "not written: a miss", False),
        (DynrespError("cannot write x"), "failed: cannot write x", True),
        (RuntimeError("a\nb"), "failed: RuntimeError: a b", True),
        (OSError(28, "No space left on device"), "failed: OSError: [Errno 28] No space", True),
        (KeyError(), "failed: KeyError", True),
    ],
)
def test_every_error_is_reported(error: Exception | None, message: str, failure: bool) -> None:
    def write(path: Path) -> None:
        if error is not None:
            raise error

    reported = folder.attempt(write, Path("x"))
    assert reported.startswith(message)
    assert folder.is_failure(reported) is failure


def test_an_interruption_is_none_of_it() -> None:
    def write(path: Path) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        folder.attempt(write, Path("x"))
