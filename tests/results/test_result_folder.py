import json
from pathlib import Path

import pytest

from dynresp.results import result_folder as folder
from dynresp.support.errors import DynrespError, UsageError
from dynresp.support.inputs import inputs_noted, open_input
from dynresp.view.video_writer import RenderingUnavailableError

RESPONSE = ("motion.npz", "motion.bvh", "recording.html", "filmstrip.png", "alignment.png",
            "video.mp4")  # fmt: skip


def fill(where: Path, *names: str) -> None:
    where.mkdir(parents=True, exist_ok=True)
    for name in names:
        (where / name).write_text("somebody's")


def result(where: Path, record: str, *names: str) -> None:
    """What a result left that wrote these files."""
    for name in names:
        fill((where / name).parent, Path(name).name)
    fill(where)
    content = {"files": dict.fromkeys(names, "written"), "versions": {"dynresp": "0.1.0"}}
    (where / record).write_text(json.dumps(content))


def there(where: Path) -> list[str]:
    return sorted(path.relative_to(where).as_posix() for path in where.rglob("*"))


def test_files_of_earlier_results_are_ours(tmp_path: Path) -> None:
    result(tmp_path, "result.json", "motion.npz", "filmstrip.png")
    result(tmp_path, "summary.json", "table.csv", "hit_00004/motion.bvh", "hit_00004/result.json")
    fill(tmp_path, "notes.txt", "video.mp4")
    fill(tmp_path / "hit_00004", "notes.txt")
    own = folder.claim(tmp_path, "result.json", ["motion.npz", "motion.bvh"])
    assert own == {
        "result.json", "motion.npz", "motion.bvh", "filmstrip.png", "summary.json", "table.csv",
        "hit_00004/motion.bvh", "hit_00004/result.json",
    }  # fmt: skip
    assert folder.clear(tmp_path, own - {"result.json", "motion.npz"}) == {}
    assert there(tmp_path) == [
        "hit_00004", "hit_00004/notes.txt", "motion.npz", "notes.txt", "result.json", "video.mp4"
    ]  # fmt: skip


def test_the_folder_of_a_hit_goes_with_its_files(tmp_path: Path) -> None:
    result(tmp_path, "summary.json", "hit_00004/motion.bvh", "hit_00004/result.json")
    own = folder.claim(tmp_path, "result.json", [])
    assert folder.clear(tmp_path, own - {"result.json"}) == {}
    assert there(tmp_path) == ["result.json"]


@pytest.mark.parametrize("name", RESPONSE)
def test_files_of_nobody_are_not_replaced(tmp_path: Path, name: str) -> None:
    fill(tmp_path, name)
    with pytest.raises(UsageError, match=f"{name}.* names as its own; .*overwrite"):
        folder.claim(tmp_path, "result.json", RESPONSE)
    assert there(tmp_path) == [name]
    assert (tmp_path / name).read_text() == "somebody's"
    folder.claim(tmp_path, "result.json", RESPONSE, overwrite=True)


@pytest.mark.parametrize(
    "record",
    [
        "{}", "[]", "", "\x00", "[" * 100_000, "1" * 5_000, '{"files": {"motion.npz": "written"}}',
        '{"files": {"motion.npz": "not written: no GL"}, "versions": {"dynresp": "1"}}',
        '{"files": {"motion.npz": "failed: full"}, "versions": {"dynresp": "1"}}',
        '{"files": ["motion.npz"], "versions": {"dynresp": "1"}}',
        '{"files": {"motion.npz": ["written"]}, "versions": {"dynresp": "1"}}',
    ],
    ids=range(11),
)  # fmt: skip
def test_a_record_that_does_not_name_it(tmp_path: Path, record: str) -> None:
    fill(tmp_path, "motion.npz")
    (tmp_path / "result.json").write_text(record)
    with pytest.raises(UsageError, match=r"motion\.npz"):
        folder.claim(tmp_path, "result.json", ["motion.npz"])
    assert (tmp_path / "result.json").read_text() == record


def test_a_record_cannot_name_files_elsewhere(tmp_path: Path) -> None:
    fill(tmp_path, "motion.npz", "notes.txt")
    out = tmp_path / "out"
    fill(out / "hit_00001" / "deep", "motion.npz")
    names = ["../motion.npz", str(tmp_path / "motion.npz"), "hit_00001/deep/motion.npz",
             "hit_00001/../../motion.npz", "../notes.txt", "notes.txt"]  # fmt: skip
    content = {"files": dict.fromkeys(names, "written"), "versions": {"dynresp": "0.1.0"}}
    (out / "result.json").write_text(json.dumps(content))
    assert folder.own_files(out) == {"result.json"}


def test_inputs_are_not_replaced_even_if_allowed(tmp_path: Path) -> None:
    result(tmp_path, "result.json", "motion.npz")
    for names in (["motion.npz"], ["motion.bvh"]):  # replaced, or removed
        with pytest.raises(UsageError, match="is read for this result"):
            folder.claim(
                tmp_path, "result.json", names, inputs=[tmp_path / "motion.npz"], overwrite=True
            )
        with inputs_noted():
            open_input(tmp_path / "motion.npz").close()
            with pytest.raises(UsageError, match="is read for this result"):
                folder.claim(tmp_path, "result.json", names, overwrite=True)
    assert (tmp_path / "motion.npz").read_text() == "somebody's"


def test_what_an_interrupted_result_left_is_ours(tmp_path: Path) -> None:
    folder.claim(tmp_path, "result.json", ["motion.npz", "motion.bvh"])
    fill(tmp_path, "motion.npz")
    own = folder.claim(tmp_path, "result.json", ["motion.bvh"])
    assert folder.clear(tmp_path, own - {"result.json"}) == {}
    assert there(tmp_path) == ["result.json"]


def test_links_and_folders_of_those_names_are_left_alone(tmp_path: Path) -> None:
    result(tmp_path / "elsewhere", "result.json", *RESPONSE)
    out = tmp_path / "out"
    (out / "video.mp4").mkdir(parents=True)
    (out / "hit_00001").symlink_to(tmp_path / "elsewhere")
    assert folder.clear(out, ["video.mp4", *(f"hit_00001/{name}" for name in RESPONSE)]) == {}
    assert (out / "video.mp4").is_dir()
    assert len(there(tmp_path / "elsewhere")) == len(RESPONSE) + 1


def test_what_cannot_be_removed_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unlink(path: Path, missing_ok: bool = False) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "unlink", unlink)
    failed = folder.clear(tmp_path, ["result.json", "hit_00001/motion.npz"])
    assert set(failed) == {"result.json", "hit_00001/motion.npz"}
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
