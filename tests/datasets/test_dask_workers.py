"""A real Dask scheduler and real worker processes on loopback."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from dynresp.datasets import dask_workers as cluster
from dynresp.datasets.sample_worker import Job, SampleWorker
from dynresp.datasets.shards import shard_ranges
from dynresp.support.errors import DynrespError, MissingExtraError, UsageError

from .samples import command, files, plan, ran, write_plan

pytest.importorskip("distributed")

DASK = [sys.executable, "-m", "dask"]


def awaited(what: Callable[[], object]) -> None:
    until = time.monotonic() + 600.0
    while not what():
        assert time.monotonic() < until, "waited for too long"
        time.sleep(0.02)


@contextmanager
def process(words: list[str], log: Path, **environment: str) -> Iterator[subprocess.Popen[bytes]]:
    """A process that ends with the block, its output in a file."""
    with log.open("wb") as file:
        started = subprocess.Popen(
            words, stdout=file, stderr=subprocess.STDOUT, env={**os.environ, **environment}
        )
    try:
        yield started
    finally:
        started.kill()
        started.wait(timeout=600)


@contextmanager
def scheduler(
    folder: Path, protocol: str = "tcp", **environment: str
) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """A scheduler on loopback: its address, and its process."""
    scheduler_file = folder / "scheduler.json"
    words = [*DASK, "scheduler", "--host", f"{protocol}://127.0.0.1", "--port", "0",
             "--no-dashboard", "--scheduler-file", str(scheduler_file)]  # fmt: skip
    with process(words, folder / "scheduler.log", **environment) as started:
        awaited(scheduler_file.exists)
        yield json.loads(scheduler_file.read_text())["address"], started


@contextmanager
def worker(
    address: str, folder: Path, number: int = 0, **environment: str
) -> Iterator[subprocess.Popen[bytes]]:
    """A worker process of one thread, without a nanny to start it again."""
    words = [*DASK, "worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard",
             "--host", "127.0.0.1", "--local-directory", str(folder)]  # fmt: skip
    with process(words, folder / f"worker{number}.log", **environment) as started:
        yield started


@pytest.fixture
def words(tmp_path: Path) -> list[object]:
    """A command that makes the same dataset as the fixture `dataset`."""
    return [write_plan(tmp_path), "--out", tmp_path / "out", "--motions", tmp_path,
            "--shard-size", 8]  # fmt: skip


def shards(folder: Path) -> int:
    return len(list(folder.glob("shard-*.parquet")))


@pytest.mark.slow
def test_two_workers_one_of_which_is_killed(
    tmp_path: Path, words: list[object], dataset: Path
) -> None:
    with scheduler(tmp_path) as (address, _), worker(address, tmp_path) as first:
        words += ["--scheduler", address]
        with worker(address, tmp_path, 1):
            large = [*words, "--count", 120, "--json"]
            job = subprocess.Popen(
                command(*large), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )
            awaited(lambda: shards(tmp_path / "out") >= 1)
            first.send_signal(signal.SIGKILL)
            output, errors = job.communicate(timeout=600)
            assert job.returncode == 0, errors
    content = json.loads(output)
    assert (content["samples"], content["shards_made"]) == (120, 15)
    found = files(tmp_path / "out")
    assert len(found) == 16
    # The first shards, which are full, are those of the smaller dataset.
    for name in ("shard-00000.parquet", "shard-00001.parquet"):
        assert found[name] == (dataset / name).read_bytes()


@pytest.mark.slow
def test_a_scheduler_that_dies(tmp_path: Path, words: list[object]) -> None:
    words += ["--count", 160]
    with scheduler(tmp_path) as (address, started), worker(address, tmp_path):
        job = subprocess.Popen(
            command(*words, "--scheduler", address),
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        awaited(lambda: shards(tmp_path / "out") >= 1)
        started.kill()
        output, errors = job.communicate(timeout=600)
    assert job.returncode == 1
    assert output == ""
    assert errors.splitlines()[-1].startswith("dynresp: the connection to the Dask scheduler at")
    assert "Traceback" not in errors
    there = files(tmp_path / "out")
    assert 2 <= len(there) < 21
    # On this machine alone, the same command goes on.
    done = ran(*words, "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout)["shards_made"] == 21 - len(there)
    assert files(tmp_path / "out").items() >= there.items()


@pytest.mark.slow
def test_a_worker_with_other_things_is_refused(tmp_path: Path, sample_worker: SampleWorker) -> None:
    manifest = {**sample_worker.manifest(8), "features": ["another"]}
    job = Job(plan(), tmp_path, tmp_path / "not there", manifest)
    with scheduler(tmp_path) as (address, _), ExitStack() as stack:
        # A cluster may get its workers later.
        late = worker(address, tmp_path, DYNRESP_MOTIONS=str(tmp_path))
        making = cluster.make_on_cluster(
            job, shard_ranges("x", 20, 8), address, lambda: stack.enter_context(late)
        )
        with pytest.raises(DynrespError, match=r"worker tcp://.*this machine: features"):
            next(making)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("openssl") is None, reason="makes certificates with openssl")
def test_with_tls(tmp_path: Path, words: list[object], dataset: Path) -> None:
    """As docs/datasets.md has it: Dask's own configuration, here in the environment."""
    cert, key = tmp_path / "cert.pem", tmp_path / "key.pem"
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", str(key),
         "-out", str(cert), "-days", "1", "-subj", "/CN=localhost"],
        check=True, capture_output=True,
    )  # fmt: skip
    prefix = "DASK_DISTRIBUTED__COMM__"
    environment = {f"{prefix}TLS__CA_FILE": str(cert), f"{prefix}REQUIRE_ENCRYPTION": "true"}
    for role in ("SCHEDULER", "WORKER", "CLIENT"):
        environment[f"{prefix}TLS__{role}__CERT"] = str(cert)
        environment[f"{prefix}TLS__{role}__KEY"] = str(key)
    with (
        scheduler(tmp_path, "tls", **environment) as (address, _),
        worker(address, tmp_path, **environment),
    ):
        assert address.startswith("tls://")
        without = ran(*words, "--scheduler", address)
        assert without.returncode == 2
        assert "needs certificates" in without.stderr
        done = subprocess.run(
            command(*words, "--scheduler", address),
            env={**os.environ, **environment}, capture_output=True, text=True, timeout=600,
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert files(tmp_path / "out") == files(dataset)


def refused(address: str) -> str:
    job = Job(plan(), Path(), None, {})
    with pytest.raises(UsageError) as caught:
        next(cluster.make_on_cluster(job, shard_ranges("x", 1, 1), address, lambda: None))
    return str(caught.value)


@pytest.mark.parametrize(
    "address", ["", "host", "host:1", "tcp://host", "ucx://host:1", "tcp://:x"]
)
def test_what_is_no_address_is_refused(address: str) -> None:
    assert "expected an address such as tcp://host:8786" in refused(address)


def test_without_dask(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    job = Job(plan(), Path(), None, {})
    with pytest.raises(MissingExtraError, match=r"pip install 'dynresp\[cluster\]'"):
        next(
            cluster.make_on_cluster(job, shard_ranges("x", 1, 1), "tcp://127.0.0.1:1", lambda: None)
        )


def test_nobody_listens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.5)
    job = Job(plan(), Path(), None, {})
    with pytest.raises(DynrespError, match="no Dask scheduler can be reached"):
        next(
            cluster.make_on_cluster(job, shard_ranges("x", 1, 1), "tcp://127.0.0.1:1", lambda: None)
        )


@pytest.mark.slow
def test_what_accepts_and_never_answers(words: list[object]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        done = ran(*words, "--scheduler", f"tcp://127.0.0.1:{mute.getsockname()[1]}")
    assert done.returncode == 1
    assert "no Dask scheduler has answered at" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("missing", ["ca-file", "client.cert", "client.key"])
def test_a_missing_certificate_is_named(tmp_path: Path, missing: str) -> None:
    import dask.config

    there = tmp_path / "there.pem"
    there.touch()
    names = ("ca-file", "client.cert", "client.key")
    paths = {f"distributed.comm.tls.{name}": str(there) for name in names}
    paths[f"distributed.comm.tls.{missing}"] = str(tmp_path / "gone.pem")
    with dask.config.set(paths):
        message = refused("tls://127.0.0.1:1")
    assert f"distributed.comm.tls.{missing}: '{tmp_path / 'gone.pem'}' cannot be read" in message
