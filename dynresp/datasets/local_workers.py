"""Workers on this machine: processes, one to a core.

Each is connected by a pipe of its own. When the program dies, in whatever way, its workers read
the end of their pipes and end; when a worker dies, another takes its shard.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any

from dynresp.datasets.sample_worker import Job, load
from dynresp.datasets.shards import Place
from dynresp.support.errors import DynrespError

MAX_DEATHS = 3
"""A shard that so many workers died of is given up."""

MAX_FALSE_STARTS = 10
"""As many workers, or three times the team, may die one after another before any has begun."""

# Libraries that would start threads of their own, and these would wait for each other.
_ONE_THREAD = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMBA_NUM_THREADS",
)
_STOP_S = 5.0


@dataclass
class _Worker:
    process: SpawnProcess
    pipe: Connection
    place: Place | None = None
    begun: bool = False
    done: int = 0


def cores() -> int:
    """How many cores this program may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def make_here(
    job: Job, wanted: Sequence[Place], workers: int, progress: Callable[[int], None]
) -> Generator[tuple[Place, bytes], None, None]:
    """Make shards by processes of this machine.

    Args:
        job: The job.
        wanted: The shards.
        workers: How many processes.
        progress: Told how many samples are done of shards that are not yet handed over.

    Yields:
        A shard and its Parquet file, in whatever order they are done.

    Raises:
        DynrespError: A worker could not do it, or too many died.
    """
    waiting = deque(wanted)
    deaths: Counter[int] = Counter()
    false_starts = 0
    team: list[_Worker] = []
    left = len(wanted)
    try:
        team = [_hired(job) for _ in range(min(workers, len(wanted)))]
        for worker in team:
            _next(worker, waiting)
        while left:
            for pipe in wait([worker.pipe for worker in team]):
                worker = next(w for w in team if w.pipe is pipe)
                try:
                    kind, *content = worker.pipe.recv()
                except (EOFError, OSError):
                    team.remove(worker)
                    false_starts = 0 if worker.begun else false_starts + 1
                    _mourn(worker, waiting, deaths, false_starts, workers)
                    if waiting:
                        team.append(_hired(job))
                        _next(team[-1], waiting)
                    continue
                if kind == "error":
                    raise DynrespError(content[0])
                if kind == "begun":
                    worker.begun, false_starts = True, 0
                    continue
                if kind == "done":
                    worker.done = content[0]
                    progress(sum(w.done for w in team))
                    continue
                assert worker.place is not None
                place, worker.done = worker.place, 0
                _next(worker, waiting)
                left -= 1
                yield place, content[0]
    finally:
        for worker in team:
            _dismissed(worker)


def _next(worker: _Worker, waiting: deque[Place]) -> None:
    """Give a worker its next shard, where there is one."""
    worker.place = waiting.popleft() if waiting else None
    worker.begun = False
    if worker.place is not None:
        # One that has died is noticed where its pipe is read.
        with suppress(OSError):
            worker.pipe.send(worker.place)


def _mourn(
    worker: _Worker,
    waiting: deque[Place],
    deaths: Counter[int],
    false_starts: int,
    workers: int,
) -> None:
    """Put a dead worker's shard back, unless it has killed too many.

    A worker that died before it began with its shard, while it loaded, did not die of it. Where
    none gets further than that, something is wrong with all.
    """
    worker.process.join(_STOP_S)
    code = worker.process.exitcode
    _dismissed(worker)
    place = worker.place
    if place is None:
        return
    how = f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"
    deaths[place.number] += worker.begun
    if false_starts >= max(MAX_FALSE_STARTS, 3 * workers):
        raise DynrespError(
            f"{false_starts} worker processes died one after another before they began ({how}); "
            "see whether dynresp is wholly installed, and where memory is short, give fewer "
            "--workers. Nothing is lost: the same command goes on."
        )
    if deaths[place.number] >= MAX_DEATHS:
        raise DynrespError(
            f"{MAX_DEATHS} worker processes died while making shard {place.number} ({how}); where "
            "memory is short, give fewer --workers. Nothing is lost: the same command goes on."
        )
    waiting.appendleft(place)


def _hired(job: Job) -> _Worker:
    """Start a process."""
    context = multiprocessing.get_context("spawn")
    own, other = context.Pipe()
    process = context.Process(target=_work, args=(job, other), daemon=True)
    with _as_a_worker_begins():
        process.start()
    other.close()
    return _Worker(process, own)


@contextmanager
def _as_a_worker_begins() -> Iterator[None]:
    """What a process inherits: one thread for each library, and no interruptions.

    Control-C in a terminal reaches all processes; only the first one is to act on it.
    """
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    mask = None
    if hasattr(signal, "pthread_sigmask"):
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _dismissed(worker: _Worker) -> None:
    worker.pipe.close()
    worker.process.kill()
    worker.process.join(_STOP_S)
    with suppress(ValueError):
        worker.process.close()


def _work(job: Job, pipe: Connection) -> None:
    """The whole life of a process."""

    def tell(*message: Any) -> None:
        pipe.send(message)

    try:
        try:
            workshop = load(job)
            while True:
                place: Place = pipe.recv()
                tell("begun")
                tell("made", workshop.make(place, lambda done: tell("done", done)))
        except DynrespError as error:
            tell("error", str(error))
        except (EOFError, BrokenPipeError, ConnectionResetError):
            raise
        except Exception as error:
            tell("error", f"a worker failed: {type(error).__name__}: {error}")
    except (EOFError, OSError):
        # The program that asked is gone.
        return
