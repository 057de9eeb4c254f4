"""Workers on this machine: one process per core.

Each has its own pipe. When the main program dies, its workers read the end of their pipes and end;
when a worker dies, another worker makes its shard.
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

from dynresp.datasets.sample_worker import Job, load_worker
from dynresp.datasets.shards import ShardRange
from dynresp.support.errors import DynrespError

MAX_DEATHS = 3
"""How many workers may die while they make one shard."""

MAX_FAILED_STARTS = 10
"""How many workers may die one after another before any begins with a shard; three times the number
of workers where that is more."""

# Libraries that would start their own threads, which would compete for the cores.
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
    shard: ShardRange | None = None
    begun: bool = False
    done: int = 0


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def make_locally(
    job: Job, wanted: Sequence[ShardRange], workers: int, progress: Callable[[int], None]
) -> Generator[tuple[ShardRange, bytes], None, None]:
    """Make shards with processes on this machine.

    Args:
        job: The job.
        wanted: The shards.
        workers: How many processes.
        progress: Called with the number of samples done in unfinished shards.

    Yields:
        Each shard with its Parquet file, in the order in which they are finished.

    Raises:
        DynrespError: A worker could not do it, or too many died.
    """
    waiting = deque(wanted)
    deaths: Counter[int] = Counter()
    failed_starts = 0
    team: list[_Worker] = []
    left = len(wanted)
    try:
        team = [_start_worker(job) for _ in range(min(workers, len(wanted)))]
        for worker in team:
            _next(worker, waiting)
        while left:
            for pipe in wait([worker.pipe for worker in team]):
                worker = next(w for w in team if w.pipe is pipe)
                try:
                    kind, *content = worker.pipe.recv()
                except (EOFError, OSError):
                    team.remove(worker)
                    failed_starts = 0 if worker.begun else failed_starts + 1
                    _requeue(worker, waiting, deaths, failed_starts, workers)
                    if waiting:
                        team.append(_start_worker(job))
                        _next(team[-1], waiting)
                    continue
                if kind == "error":
                    raise DynrespError(content[0])
                if kind == "begun":
                    worker.begun, failed_starts = True, 0
                    continue
                if kind == "done":
                    worker.done = content[0]
                    progress(sum(w.done for w in team))
                    continue
                assert worker.shard is not None
                shard, worker.done = worker.shard, 0
                _next(worker, waiting)
                left -= 1
                yield shard, content[0]
    finally:
        for worker in team:
            _stop_worker(worker)


def _next(worker: _Worker, waiting: deque[ShardRange]) -> None:
    """Send a worker its next shard, if there is one."""
    worker.shard = waiting.popleft() if waiting else None
    worker.begun = False
    if worker.shard is not None:
        # A dead worker is noticed when its pipe is read.
        with suppress(OSError):
            worker.pipe.send(worker.shard)


def _requeue(
    worker: _Worker,
    waiting: deque[ShardRange],
    deaths: Counter[int],
    failed_starts: int,
    workers: int,
) -> None:
    """Put a dead worker's shard back into the queue.

    A worker that died while it loaded, before it began with its shard, does not count against the
    shard.

    Raises:
        DynrespError: Too many workers died of this shard, or before any began.
    """
    worker.process.join(_STOP_S)
    code = worker.process.exitcode
    _stop_worker(worker)
    shard = worker.shard
    if shard is None:
        return
    how = f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"
    deaths[shard.number] += worker.begun
    if failed_starts >= max(MAX_FAILED_STARTS, 3 * workers):
        raise DynrespError(
            f"{failed_starts} worker processes died one after another before they began ({how}); "
            "check that dynresp is installed completely; if memory is short, give fewer "
            "--workers. Nothing is lost: the same command continues."
        )
    if deaths[shard.number] >= MAX_DEATHS:
        raise DynrespError(
            f"{MAX_DEATHS} worker processes died while making shard {shard.number} ({how}); if "
            "memory is short, give fewer --workers. Nothing is lost: the same command continues."
        )
    waiting.appendleft(shard)


def _start_worker(job: Job) -> _Worker:
    """Start a process."""
    context = multiprocessing.get_context("spawn")
    own, other = context.Pipe()
    process = context.Process(target=_work, args=(job, other), daemon=True)
    with _worker_environment():
        process.start()
    other.close()
    return _Worker(process, own)


@contextmanager
def _worker_environment() -> Iterator[None]:
    """What a worker inherits: one thread per library, and blocked interrupts.

    Control-C in a terminal reaches all processes; only the main program acts on it.
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


def _stop_worker(worker: _Worker) -> None:
    worker.pipe.close()
    worker.process.kill()
    worker.process.join(_STOP_S)
    with suppress(ValueError):
        worker.process.close()


def _work(job: Job, pipe: Connection) -> None:
    """What a worker process does: load the job, then make one shard after another."""

    def report(*message: Any) -> None:
        pipe.send(message)

    try:
        try:
            sample_worker = load_worker(job)
            while True:
                shard: ShardRange = pipe.recv()
                report("begun")
                report("made", sample_worker.make(shard, lambda done: report("done", done)))
        except DynrespError as error:
            report("error", str(error))
        except (EOFError, BrokenPipeError, ConnectionResetError):
            raise
        except Exception as error:
            report("error", f"a worker failed: {type(error).__name__}: {error}")
    except (EOFError, OSError):
        # The main program has ended.
        return
