"""`dynresp generate` as a process of its own, killed and interrupted."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from .samples import command, files, ran, write_plan

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


@pytest.fixture
def words(tmp_path: Path) -> tuple[object, ...]:
    """A command that makes the same dataset as the fixture `dataset`."""
    return (write_plan(tmp_path), "--out", tmp_path / "out", "--motions", tmp_path,
            "--shard-size", 8, "--workers", 2)  # fmt: skip


def workers_of(process: subprocess.Popen[str]) -> list[int]:
    """The worker processes of a command."""
    found = []
    with suppress(OSError):
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        for child in children:
            if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                found.append(int(child))
    return found


def awaited(what: Callable[[], bool]) -> None:
    until = time.monotonic() + 600.0
    while not what():
        assert time.monotonic() < until, "waited for too long"
        time.sleep(0.01)


def gone(pid: int) -> bool:
    try:
        return "\nState:\tZ" in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return True


def started(words: tuple[object, ...]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command(*words), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip


def shards(folder: Path) -> set[str]:
    return {path.name for path in folder.glob("shard-*.parquet")}


@pytest.mark.slow
def test_killed_again_and_again_it_gives_the_same_bytes(
    words: tuple[object, ...], tmp_path: Path, dataset: Path
) -> None:
    out = tmp_path / "out"
    for least in (0, 1, 2):
        with started((*words, "--workers", 1)) as job:
            awaited(
                lambda least=least: (out / "manifest.json").exists() and len(shards(out)) >= least
            )
            team = workers_of(job)
            job.kill()
            job.wait(timeout=600)
            # Its workers notice that they are alone.
            awaited(lambda team=team: all(gone(pid) for pid in team))
        # What stands under a final name is whole.
        for name in shards(out):
            assert (out / name).read_bytes() == (dataset / name).read_bytes()
    done = ran(*words)
    assert done.returncode == 0, done.stderr
    assert files(out) == files(dataset)


@pytest.mark.slow
def test_a_killed_worker_costs_nothing(
    words: tuple[object, ...], tmp_path: Path, dataset: Path
) -> None:
    with started(words) as job:
        awaited(lambda: len(workers_of(job)) == 2)
        os.kill(workers_of(job)[0], signal.SIGKILL)
        _, errors = job.communicate(timeout=600)
        assert job.returncode == 0, errors
    assert files(tmp_path / "out") == files(dataset)


@pytest.mark.slow
@pytest.mark.parametrize("whole_group", [False, True], ids=["kill -2", "control-C"])
def test_an_interruption_ends_it_in_order(
    words: tuple[object, ...], tmp_path: Path, dataset: Path, whole_group: bool
) -> None:
    with started(words) as job:
        awaited(lambda: len(workers_of(job)) == 2)
        team = workers_of(job)
        if whole_group:
            os.killpg(job.pid, signal.SIGINT)
        else:
            job.send_signal(signal.SIGINT)
        output, errors = job.communicate(timeout=600)
        assert job.returncode == 130
    assert output == ""
    assert errors.endswith("dynresp: interrupted\n")
    assert "Traceback" not in errors
    assert all(gone(pid) for pid in team)
    assert ran(*words).returncode == 0
    assert files(tmp_path / "out") == files(dataset)


@pytest.mark.slow
def test_a_file_that_cannot_be_written_ends_it(tmp_path: Path) -> None:
    """A limit on the size of files stands in for a full disk: the system itself refuses."""
    out, plan = tmp_path / "out", write_plan(tmp_path)
    words = ["generate", str(plan), "--out", str(out), "--motions", str(tmp_path)]
    code = (
        "import resource, sys, dynresp.cli\n"
        f"sys.argv = ['dynresp', *{words!r}, '--shard-size', '20']\n"
        # The manifest is smaller than that, a shard larger.
        "resource.setrlimit(resource.RLIMIT_FSIZE, (25_000, 25_000))\n"
        "dynresp.cli.main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600)
    assert done.returncode == 1
    assert "dynresp: cannot write" in done.stderr
    assert "Traceback" not in done.stderr
    assert {path.name for path in out.iterdir()} == {"manifest.json"}
    assert ran(plan, "--out", out, "--motions", tmp_path).returncode == 0
    assert shards(out) == {"shard-00000.parquet"}
