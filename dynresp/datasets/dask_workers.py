"""Workers of a Dask cluster, which may be other machines.

A worker gets the spec, and loads motions and library itself. Shards come back to the main program,
which alone writes. TLS is set in Dask's own configuration.
"""

from __future__ import annotations

import logging
import queue
import re
import secrets
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from dynresp.datasets.sample_worker import Job, SampleWorker, load_worker
from dynresp.datasets.shards import ShardRange
from dynresp.support.errors import DynrespError, UsageError
from dynresp.support.extras import require

if TYPE_CHECKING:
    from distributed import Client

# Shards in flight for each thread of the cluster, so that no thread waits; and at least.
_SHARDS_PER_THREAD, _MIN_IN_FLIGHT = 2, 4
_CONNECT_S = 20.0
# Extra time for Dask's own error message.
_EXTRA_S = 1.0
_POLL_S = 0.5
_ADDRESS = re.compile(r"(tcp|tls)://[^/\s]+:\d{1,5}")
# Loaded once in each thread of a worker: it is not thread-safe.
_thread_state = threading.local()


def make_on_cluster(
    job: Job, wanted: Sequence[ShardRange], address: str, waiting: Callable[[], None]
) -> Generator[tuple[ShardRange, bytes], None, None]:
    """Make shards with the workers of a running Dask scheduler.

    A shard whose worker dies is done by another one.

    Args:
        job: The job.
        wanted: The shards.
        address: Of the scheduler, such as "tcp://10.0.0.1:8786" or "tls://...".
        waiting: Called once if the scheduler has no workers yet.

    Yields:
        Each shard with its Parquet file, in the order in which they are finished.

    Raises:
        MissingExtraError: Dask is not installed.
        UsageError: The address is none, or certificates are missing.
        DynrespError: The scheduler cannot be reached or is gone; a worker could not do it; or too
            many workers died of one shard.
    """
    security = connection_security(address)
    with _without_logging():
        client = _connect(address, security)
        try:
            _wait_for_workers(client, address, waiting)
            yield from _shards_from_cluster(client, job, wanted, address)
        finally:
            # Cancels the shards in flight, too.
            with suppress(Exception):
                client.close(timeout=2)


def connection_security(address: str) -> Any:
    """The security settings of Dask's configuration; does not connect.

    Args:
        address: Of the scheduler.

    Returns:
        Dask's `distributed.Security`.

    Raises:
        MissingExtraError: Dask is not installed.
        UsageError: The address is none, or it asks for TLS and the
            configuration has no certificates for that, or names files that cannot be read.
    """
    require("distributed")
    from distributed.security import Security

    if not _ADDRESS.fullmatch(address):
        raise UsageError(
            f"--scheduler: expected an address such as tcp://host:8786 or tls://host:8786, got "
            f"{address!r}"
        )
    try:
        security = Security()
        _check_files(security)
        safe = security.get_connection_args("client").get("ssl_context") is not None
    except (OSError, ValueError, TypeError) as error:
        raise UsageError(f"Dask's configuration of TLS is wrong: {_error_text(error)}") from None
    if address.startswith("tls:") and not safe:
        raise UsageError(
            f"--scheduler: {address!r} needs certificates, and Dask's configuration names none; "
            "set distributed.comm.tls as docs/datasets.md says"
        )
    return security


def _check_files(security: Any) -> None:
    """Refuse certificates that cannot be read, with their names, which the errors of ssl lack."""
    places = {"ca_file": "ca-file", "cert": "client.cert", "key": "client.key"}
    files = security.get_tls_config_for_role("client")
    if not (files.get("ca_file") and files.get("cert")):
        # Dask uses both or neither.
        return
    for key, shard in places.items():
        path = files.get(key)
        # A value with several lines is the certificate itself.
        if path is None or "\n" in path:
            continue
        try:
            with open(path, "rb"):
                pass
        except OSError as error:
            raise UsageError(
                f"Dask's configuration of TLS is wrong: distributed.comm.tls.{shard}: {path!r} "
                f"cannot be read ({error.strerror})"
            ) from None


@contextmanager
def _without_logging() -> Iterator[None]:
    """Silence Dask's logging; dynresp has its own messages about the connection."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    levels = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


def _connect(address: str, security: Any) -> Client:
    from distributed import Client

    came: queue.SimpleQueue[Client | Exception] = queue.SimpleQueue()

    def connect() -> None:
        try:
            client = Client(address, timeout=limit, set_as_default=False, security=security)
        except Exception as error:
            came.put(error)
        else:
            came.put(client)

    # Dask limits the wait for a connection, but not for the first answer. So this waits in a daemon
    # thread, which is abandoned if no answer comes.
    limit = _CONNECT_S
    threading.Thread(target=connect, daemon=True).start()
    try:
        found = came.get(timeout=limit + _EXTRA_S)
    except queue.Empty:
        raise DynrespError(
            f"--scheduler: no Dask scheduler has answered at {address!r} within {limit:g} s; "
            "check the address, and that the scheduler runs"
        ) from None
    if isinstance(found, (OSError, ValueError, TypeError, RuntimeError)):
        raise DynrespError(
            f"--scheduler: no Dask scheduler can be reached at {address!r} ({_error_text(found)}); "
            "start one with `dask scheduler`, and see docs/datasets.md for TLS"
        )
    if isinstance(found, Exception):
        raise found
    return found


def _wait_for_workers(client: Client, address: str, waiting: Callable[[], None]) -> None:
    called = False
    while not _cluster_threads(client, address):
        if not called:
            waiting()
            called = True
        time.sleep(_POLL_S)


def _cluster_threads(client: Client, address: str) -> int:
    """Threads of all workers: how many shards the cluster makes at once."""
    try:
        found: dict[str, int] = client.sync(client.scheduler.ncores, callback_timeout=_CONNECT_S)
    except Exception:
        raise _lost_connection(address) from None
    return sum(found.values())


def _shards_from_cluster(
    client: Client, job: Job, wanted: Sequence[ShardRange], address: str
) -> Generator[tuple[ShardRange, bytes], None, None]:
    from distributed import as_completed

    run = secrets.token_hex(4)
    in_flight: dict[Any, ShardRange] = {}
    finished = as_completed(loop=client.loop)
    left = list(reversed(wanted))
    while left or in_flight:
        room = max(_MIN_IN_FLIGHT, _SHARDS_PER_THREAD * _cluster_threads(client, address)) - len(
            in_flight
        )
        for _ in range(min(room, len(left))):
            shard = left.pop()
            key = f"dynresp-{run}-{shard.name}"
            # Earlier shards first, wherever they are.
            future = client.submit(
                make_on_worker, job, shard, key=key, pure=False, priority=-shard.number
            )
            in_flight[future] = shard
            finished.add(future)
        future = next(finished)
        shard = in_flight.pop(future)
        yield shard, _result(future, shard, address)


def _result(future: Any, shard: ShardRange, address: str) -> bytes:
    from distributed import KilledWorker

    try:
        data = future.result(timeout=_CONNECT_S)
    except DynrespError:
        raise
    except KilledWorker:
        raise DynrespError(
            f"the workers that were to make shard {shard.number} died, one after the other; look "
            "into their logs (memory?). Nothing is lost: the same command continues."
        ) from None
    except Exception as error:
        if future.status == "error":
            raise DynrespError(
                f"a worker failed on shard {shard.number}: {_error_text(error)}; the same version "
                "of dynresp must be installed there"
            ) from None
        raise _lost_connection(address) from None
    if not isinstance(data, bytes):
        raise DynrespError(f"a worker gave a {type(data).__name__} as shard {shard.number}")
    return data


def make_on_worker(job: Job, shard: ShardRange) -> bytes:
    """Make one shard; a Dask worker runs this.

    Raises:
        DynrespError: It could not be done there.
    """
    try:
        return _loaded_worker(job).make(shard)
    except DynrespError as error:
        from distributed import get_worker

        # The base class: others may not survive pickling.
        raise DynrespError(f"worker {get_worker().address}: {error}") from None


def _loaded_worker(job: Job) -> SampleWorker:
    key = (job.manifest["identity"], job.spec_folder, job.motions)
    if getattr(_thread_state, "key", None) != key:
        # The folder of the job if it exists here, else this machine's own DYNRESP_MOTIONS.
        here = job.motions is not None and job.motions.is_dir()
        _thread_state.worker = load_worker(job if here else replace(job, motions=None))
        _thread_state.key = key
    sample_worker: SampleWorker = _thread_state.worker
    return sample_worker


def _lost_connection(address: str) -> DynrespError:
    return DynrespError(
        f"the connection to the Dask scheduler at {address!r} is lost. Finished shards are kept: "
        "when the scheduler runs again, the same command continues."
    )


def _error_text(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:200]}" if text else type(error).__name__
