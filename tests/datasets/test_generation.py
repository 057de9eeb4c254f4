import errno
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dynresp.datasets import generation as making
from dynresp.datasets.dataset_reader import load_dataset
from dynresp.datasets.dataset_spec import DatasetSpec
from dynresp.datasets.generation import Summary, generate
from dynresp.datasets.manifest import MANIFEST
from dynresp.datasets.sample_worker import Job, SampleWorker, load_worker
from dynresp.datasets.shard_schema import columns
from dynresp.datasets.shards import ShardRange, decode
from dynresp.support.errors import DynrespError, UsageError

from .samples import files, plan

pytestmark = pytest.mark.usefixtures("made_in_this_process")


@pytest.fixture
def copied(dataset: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(dataset, tmp_path / "copy"))


def run(out: Path, what: DatasetSpec | None = None, **more: Any) -> Summary:
    # Motions come from an empty folder, which any folder without motions is.
    return generate(what or plan(), out.parent, out, motions=out.parent, **more)


def test_a_dataset_is_made(dataset: Path, tmp_path: Path) -> None:
    stages: list[tuple[str, int, int]] = []
    summary = run(tmp_path / "a/b", shard_size=8, progress=lambda *stage: stages.append(stage))
    assert files(tmp_path / "a/b") == files(dataset)
    content = summary.to_json()
    assert content["samples"] == content["samples_made"] == 20
    assert content["hits"] + content["misses"] + content["diverged"] == 20
    assert (content["shards"], content["shards_made"], content["shards_remade"]) == (3, 3, 0)
    assert content["samples_per_s"] > 0
    assert stages[-1] == ("labelling", 20, 20)


def test_a_sample_alone_is_the_same_as_among_others(
    dataset: Path, sample_worker: SampleWorker
) -> None:
    data = load_dataset(dataset)
    layout = columns(len(data.facts.feature_names), len(data.facts.classes))
    for index in (0, 7, 13):
        place = ShardRange("alone", 0, index, 1)
        alone = decode(sample_worker.make(place), layout, place, "alone")
        for name in ("features", "errors", "label", "exit_frames", "entry_frames", "outcome"):
            assert alone[name].tobytes() == getattr(data, name)[[index]].tobytes(), name
        assert alone["contact_point"].tobytes() == data.contact_point[[index]].tobytes()
        assert alone["time_s"].tobytes() == data.parameters["time_s"][[index]].tobytes()


def test_the_size_of_shards_changes_no_sample(dataset: Path, tmp_path: Path) -> None:
    run(tmp_path / "out", shard_size=11)
    one, other = load_dataset(dataset), load_dataset(tmp_path / "out")
    assert one.features.tobytes() == other.features.tobytes()
    assert one.errors.tobytes() == other.errors.tobytes()


def test_the_order_of_shards_changes_nothing(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_order = making.make_locally
    monkeypatch.setattr(
        making, "make_locally", lambda job, wanted, *rest: in_order(job, wanted[::-1], *rest)
    )
    run(tmp_path / "out", shard_size=8)
    assert files(tmp_path / "out") == files(dataset)


def test_what_is_there_is_not_made_again(copied: Path, made_in_this_process: list[int]) -> None:
    before = {path: path.stat().st_mtime_ns for path in copied.glob("shard-*")}
    content = run(copied).to_json()
    assert made_in_this_process == []
    assert {path: path.stat().st_mtime_ns for path in copied.glob("shard-*")} == before
    assert (content["samples"], content["samples_made"]) == (20, 0)
    assert content["samples_per_s"] is None


def _flip(path: Path, also: object = None) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize(
    "damage",
    [
        _flip,
        lambda path: path.unlink(),
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(path.read_bytes()[:-50]),
        lambda path: path.write_bytes((path.parent / "shard-00000.parquet").read_bytes()),
        lambda path: _flip(path, (path.parent / MANIFEST).write_bytes(b"{")),
        lambda path: _flip(path, (path.parent / MANIFEST).unlink()),
    ],
    ids=["changed", "missing", "empty", "cut", "swapped", "manifest_damaged", "manifest_missing"],
)
def test_what_is_damaged_is_made_again(
    copied: Path,
    dataset: Path,
    made_in_this_process: list[int],
    damage: Callable[[Path], Any],
) -> None:
    damage(copied / "shard-00001.parquet")
    there = (copied / "shard-00001.parquet").exists()
    summary = run(copied, shard_size=8)
    assert made_in_this_process == [1]
    assert (summary.made, summary.remade) == ((0, 1) if there else (1, 0))
    assert files(copied) == files(dataset)
    assert summary.samples == 20


def test_half_written_files_are_cleared_away(copied: Path, dataset: Path) -> None:
    (copied / ".shard-00001-0123456789ab.parquet").write_bytes(b"half")
    (copied / ".manifest-0123456789ab.json").write_bytes(b"half")
    (copied / "notes.txt").write_text("mine")
    run(copied)
    found = files(copied)
    assert found.pop("notes.txt") == b"mine"
    assert found == files(dataset)


def test_a_larger_count_extends(
    dataset: Path, tmp_path: Path, made_in_this_process: list[int]
) -> None:
    out = tmp_path / "out"
    run(out, plan(count=13), shard_size=8)
    # The last shard, of five samples, is made again.
    summary = run(out, plan(count=20, name="A test"))
    assert made_in_this_process == [0, 1, 1, 2]
    assert (summary.made, summary.remade) == (1, 1)
    assert files(out) == files(dataset)


def test_a_smaller_count_is_refused(copied: Path, dataset: Path) -> None:
    with pytest.raises(UsageError, match="holds a dataset of 20 samples, more than the 13 to make"):
        run(copied, plan(count=13))
    (copied / MANIFEST).unlink()
    with pytest.raises(UsageError, match="of at least 20 samples, more than the 13 to make"):
        run(copied, plan(count=13), shard_size=8)
    assert (copied / "shard-00002.parquet").exists()
    (copied / "shard-00002.parquet").write_bytes(b"")
    with pytest.raises(UsageError, match="holds more than 16 samples"):
        run(copied, plan(count=16), shard_size=8)


@pytest.mark.parametrize("size", [None, 8])
def test_a_smaller_last_shard_is_refused_without_a_manifest(
    copied: Path, dataset: Path, size: int | None
) -> None:
    (copied / MANIFEST).write_bytes(b"{")
    with pytest.raises(UsageError, match="give --count 20 or more"):
        run(copied, plan(count=17), shard_size=size)
    assert (copied / "shard-00002.parquet").read_bytes() == (
        dataset / "shard-00002.parquet"
    ).read_bytes()


@pytest.mark.parametrize("size", [8, 20, 500])
@pytest.mark.parametrize("damage", [lambda p: p.write_bytes(b"{"), Path.unlink])
def test_shards_without_a_manifest_say_their_size(
    tmp_path: Path,
    made_in_this_process: list[int],
    size: int,
    damage: Callable[[Path], Any],
) -> None:
    out = tmp_path / "out"
    run(out, shard_size=size)
    before = files(out)
    made_in_this_process.clear()
    damage(out / MANIFEST)
    run(out)
    assert made_in_this_process == []
    assert files(out) == before


def test_a_foreign_shard_is_made_again_where_the_manifest_is_whole(
    copied: Path, dataset: Path, tmp_path: Path, made_in_this_process: list[int]
) -> None:
    other = tmp_path / "other"
    run(other, plan(seed=6), shard_size=8)
    made_in_this_process.clear()
    shutil.copy(other / "shard-00001.parquet", copied)
    foreign = files(copied)
    assert run(copied).remade == 1
    assert made_in_this_process == [1]
    assert files(copied) == files(dataset)
    # What a folder without a manifest is, its shards must agree upon.
    shutil.copy(other / "shard-00001.parquet", copied)
    (copied / MANIFEST).write_bytes(b"{")
    with pytest.raises(UsageError, match=r"shard-00001\.parquet: a shard of another dataset"):
        run(copied)
    assert files(copied) == {**foreign, MANIFEST: b"{"}


def test_folders_made_in_vain_go_again(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    with pytest.raises(UsageError, match="does not exist"):
        generate(plan(seed=7), tmp_path, out, motions=tmp_path / "none")
    assert not out.parent.exists()
    out.mkdir(parents=True)
    with pytest.raises(UsageError, match="does not exist"):
        generate(plan(seed=7), tmp_path, out, motions=tmp_path / "none")
    assert out.exists()


def test_a_wrong_address_is_refused_before_anything(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    stages: list[str] = []
    with pytest.raises(UsageError, match="expected an address such as"):
        run(tmp_path / "out", scheduler="foo", progress=lambda stage, *_: stages.append(stage))
    assert stages == []
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("what", "size", "message"),
    [
        (plan(seed=6), None, r"plan\.plan\.seed"),
        (plan(), 9, "shard_size"),
        (
            plan().model_copy(update={"impact": plan().impact[:1]}),
            None,
            r"plan\.impact",
        ),
    ],
    ids=["seed", "size", "impacts"],
)
def test_another_dataset_is_refused(
    copied: Path, dataset: Path, what: DatasetSpec, size: int | None, message: str
) -> None:
    with pytest.raises(UsageError, match=f"holds another dataset, with another {message}"):
        run(copied, what, shard_size=size)
    assert files(copied) == files(dataset)
    # Nor without its manifest.
    (copied / MANIFEST).unlink()
    with pytest.raises(UsageError, match=r"shard-00000\.parquet: a shard of another dataset"):
        run(copied, what, shard_size=size or 8)


def test_another_version_is_refused(copied: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dynresp.datasets import manifest

    monkeypatch.setattr(manifest, "versions", lambda: {"dynresp": "9", "mujoco": "9"})
    with pytest.raises(UsageError, match=r"with another versions\.dynresp, versions\.mujoco"):
        run(copied)


def test_a_full_disk(dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = Path.write_bytes
    left = 2

    def fill(self: Path, data: bytes) -> int:
        nonlocal left
        left -= 1
        if left >= 0:
            return write(self, data)
        write(self, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    out = tmp_path / "out"
    monkeypatch.setattr(Path, "write_bytes", fill)
    with pytest.raises(DynrespError, match=r"cannot write .*: No space left on device") as caught:
        run(out, shard_size=8)
    assert caught.value.exit_code == 1
    names = {MANIFEST, "shard-00000.parquet", "shard-00001.parquet"}
    assert {path.name for path in out.iterdir()} == names
    monkeypatch.setattr(Path, "write_bytes", write)
    assert run(out).made == 1
    assert files(out) == files(dataset)


def test_two_at_a_time_are_refused(copied: Path) -> None:
    with (
        making._locked(copied),
        pytest.raises(DynrespError, match="another `dynresp generate` is writing"),
    ):
        run(copied)
    run(copied)


def test_folders_that_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="is a file; give a folder for the dataset"):
        run(tmp_path / "file")
    with pytest.raises(UsageError, match="cannot be made"):
        run(tmp_path / "file" / "sub")


def test_a_worker_that_has_something_else_refuses(
    sample_worker: SampleWorker, tmp_path: Path
) -> None:
    job = Job(plan(), tmp_path, tmp_path, sample_worker.manifest(8))
    assert load_worker(job).manifest(8) == job.manifest
    other = {**job.manifest, "versions": {**job.manifest["versions"], "mujoco": "3.99"}}
    with pytest.raises(DynrespError, match=r"this machine: versions\.mujoco\. Install the same"):
        load_worker(replace(job, manifest=other))


def test_a_shard_that_came_damaged_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    good = making.make_locally
    monkeypatch.setattr(
        making,
        "make_locally",
        lambda *given: ((place, data[:-9]) for place, data in good(*given)),
    )
    with pytest.raises(DynrespError, match="shard 0, as it was made: damaged"):
        run(tmp_path / "out", shard_size=8)
    assert not list((tmp_path / "out").glob("shard*"))


def test_diverged_samples_are_kept_and_marked(
    sample_worker: SampleWorker, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from dynresp.response.search.hit_labels import HitLabels

    label = sample_worker._labeller.label

    def diverging(hits: Any) -> HitLabels:
        found = label(hits)
        found.outcome[0] = 2
        return found

    monkeypatch.setattr(sample_worker._labeller, "label", diverging)
    summary = run(tmp_path / "out", shard_size=10)
    assert summary.outcomes["diverged"] == 2
    data = load_dataset(tmp_path / "out")
    assert np.flatnonzero(data.outcome == 2).tolist() == [0, 10]
    assert 0 not in load_dataset(tmp_path / "out", hits_only=True).index
