"""Real worker processes, which live and die."""

import os
import signal
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pytest

from dynresp.datasets import local_workers as processes
from dynresp.datasets.local_workers import make_locally
from dynresp.datasets.sample_worker import Job, SampleWorker
from dynresp.datasets.shards import ShardRange, shard_ranges
from dynresp.support.errors import DynrespError

from .samples import files, plan

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals differ on Windows")


def quick(job: Any, pipe: Connection) -> None:
    """A worker whose shards are their own number, and which can be made to die."""
    marks: Path = job
    while True:
        try:
            place: ShardRange = pipe.recv()
        except EOFError:
            return
        mark = marks / f"{place.number}"
        if place.identity == "kills while loading" and len(list(marks.iterdir())) < 7:
            (marks / str(os.getpid())).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        pipe.send(("begun",))
        if place.identity == "kills once" and place.number == 2 and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        if place.identity == "kills" and place.number == 2:
            os.kill(os.getpid(), signal.SIGKILL)
        if place.identity == "refuses":
            pipe.send(("error", "no such motion"))
            continue
        pipe.send(("done", place.rows // 2))
        pipe.send(("made", str(place.number).encode()))


def dies_at_once(job: Any, pipe: Connection) -> None:
    raise SystemExit(3)


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "_work", quick)


def collected(folder: Path, identity: str, reported: list[int] | None = None) -> list[int]:
    wanted = shard_ranges(identity, 20, 4)
    counts = [] if reported is None else reported
    found = list(make_locally(folder, wanted, 2, counts.append))  # type: ignore[arg-type]
    assert all(data == str(place.number).encode() for place, data in found)
    return [place.number for place, _ in found]


@pytest.mark.usefixtures("stand_in")
def test_every_shard_is_made_once(tmp_path: Path) -> None:
    reported: list[int] = []
    assert sorted(collected(tmp_path, "x", reported)) == [0, 1, 2, 3, 4]
    assert set(reported) <= {2, 4}


@pytest.mark.usefixtures("stand_in")
def test_the_shard_of_a_killed_worker_is_made_by_another(tmp_path: Path) -> None:
    assert sorted(collected(tmp_path, "kills once")) == [0, 1, 2, 3, 4]
    assert (tmp_path / "2").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("stand_in")
def test_a_shard_that_kills_every_worker_is_given_up(tmp_path: Path) -> None:
    with pytest.raises(DynrespError) as caught:
        collected(tmp_path, "kills")
    assert "3 worker processes died while making shard 2 (signal 9)" in str(caught.value)
    assert "the same command continues" in str(caught.value)


@pytest.mark.slow
@pytest.mark.usefixtures("stand_in")
def test_deaths_before_a_worker_begins_do_not_count_against_a_shard(tmp_path: Path) -> None:
    assert sorted(collected(tmp_path, "kills while loading")) == [0, 1, 2, 3, 4]
    assert len(list(tmp_path.iterdir())) >= 7


@pytest.mark.slow
def test_workers_that_die_at_once_are_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processes, "_work", dies_at_once)
    message = r"10 worker processes died one after another before they began \(exit code 3\)"
    with pytest.raises(DynrespError, match=message):
        collected(tmp_path, "x")


@pytest.mark.usefixtures("stand_in")
def test_errors_of_a_worker_are_reported(tmp_path: Path) -> None:
    with pytest.raises(DynrespError, match="no such motion"):
        collected(tmp_path, "refuses")


@pytest.mark.usefixtures("stand_in")
def test_nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import multiprocessing

    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    before = dict(os.environ)
    making = make_locally(tmp_path, shard_ranges("x", 20, 4), 2, lambda done: None)  # type: ignore[arg-type]
    next(making)
    assert len(multiprocessing.active_children()) == 2
    making.close()
    assert multiprocessing.active_children() == []
    assert dict(os.environ) == before
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, set())


@pytest.mark.slow
def test_two_workers_make_the_same_bytes(
    sample_worker: SampleWorker, dataset: Path, tmp_path: Path
) -> None:
    manifest = sample_worker.manifest(8)
    job = Job(plan(), tmp_path, tmp_path, manifest)
    reported: list[int] = []
    made = make_locally(job, shard_ranges(manifest["identity"], 20, 8), 2, reported.append)
    found = {place.name: data for place, data in made}
    assert found == {k: v for k, v in files(dataset).items() if k.startswith("shard")}
    assert max(reported) >= 8


@pytest.mark.slow
def test_a_worker_that_lacks_something_says_so(sample_worker: SampleWorker, tmp_path: Path) -> None:
    manifest = {**sample_worker.manifest(8), "features": ["another"]}
    job = Job(plan(), tmp_path, tmp_path, manifest)
    with pytest.raises(DynrespError, match="this machine: features"):
        list(make_locally(job, shard_ranges("x", 20, 8), 1, lambda done: None))
