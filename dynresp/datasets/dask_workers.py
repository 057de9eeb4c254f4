"""Workers of a Dask cluster, which may be other machines.

A worker gets the plan and loads motions and library itself; shards come back to the program that
asked, which alone writes. How a connection is made safe (TLS) is Dask's own configuration.
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

from dynresp.datasets.sample_worker import Job, Workshop, load
from dynresp.datasets.shards import Place
from dynresp.support.errors import DynrespError, UsageError
from dynresp.support.extras import require

if TYPE_CHECKING:
    from distributed import Client

# Shards in flight for each thread of the cluster, so that none waits for the next; and at least.
_AHEAD, _LEAST = 2, 4
_CONNECT_S = 20.0
# Beyond that, for Dask to say itself why it could not connect.
_GRACE_S = 1.0
_LOOK_S = 0.5
_ADDRESS = re.compile(r"(tcp|tls)://[^/\s]+:\d{1,5}")
# Loaded once in each thread of a worker: a workshop is no thing for two threads at once.
_own = threading.local()


def make_there(
    job: Job, wanted: Sequence[Place], address: str, waiting: Callable[[], None]
) -> Generator[tuple[Place, bytes], None, None]:
    """Make shards by the workers of a running Dask scheduler.

    A shard whose worker dies is done by another one.

    Args:
        job: The job.
        wanted: The shards.
        address: Of the scheduler, such as "tcp://10.0.0.1:8786" or "tls://...".
        waiting: Called once where the scheduler has no workers yet.

    Yields:
        A shard and its Parquet file, in whatever order they are done.

    Raises:
        MissingExtraError: Dask is not installed.
        UsageError: The address is none, or certificates are missing.
        DynrespError: The scheduler cannot be reached or is gone; a worker could not do it; or too
            many workers died of one shard.
    """
    security = connection_security(address)
    with _quiet():
        client = _connected(address, security)
        try:
            _await_workers(client, address, waiting)
            yield from _made(client, job, wanted, address)
        finally:
            # Takes back what is in flight, too.
            with suppress(Exception):
                client.close(timeout=2)


def connection_security(address: str) -> Any:
    """How Dask's configuration makes connections safe; nothing is connected yet.

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
        raise UsageError(f"Dask's configuration of TLS is wrong: {_short(error)}") from None
    if address.startswith("tls:") and not safe:
        raise UsageError(
            f"--scheduler: {address!r} needs certificates, and Dask's configuration names none; "
            "set distributed.comm.tls as docs/datasets.md says"
        )
    return security


def _check_files(security: Any) -> None:
    """Refuse certificates that cannot be read, by name: the errors of Python's ssl have none."""
    places = {"ca_file": "ca-file", "cert": "client.cert", "key": "client.key"}
    files = security.get_tls_config_for_role("client")
    if not (files.get("ca_file") and files.get("cert")):
        # Dask makes no use of one without the other.
        return
    for key, place in places.items():
        path = files.get(key)
        # What has several lines is the certificate itself.
        if path is None or "\n" in path:
            continue
        try:
            with open(path, "rb"):
                pass
        except OSError as error:
            raise UsageError(
                f"Dask's configuration of TLS is wrong: distributed.comm.tls.{place}: {path!r} "
                f"cannot be read ({error.strerror})"
            ) from None


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask from logging: what becomes of the connection is said in the product's own words."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    levels = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


def _connected(address: str, security: Any) -> Client:
    from distributed import Client

    came: queue.SimpleQueue[Client | Exception] = queue.SimpleQueue()

    def connect() -> None:
        try:
            client = Client(address, timeout=limit, set_as_default=False, security=security)
        except Exception as error:
            came.put(error)
        else:
            came.put(client)

    # Dask bounds the wait for a connection, but not that for the first answer. So it waits in a
    # thread, which is left to itself where no answer comes, and does not keep the program.
    limit = _CONNECT_S
    threading.Thread(target=connect, daemon=True).start()
    try:
        found = came.get(timeout=limit + _GRACE_S)
    except queue.Empty:
        raise DynrespError(
            f"--scheduler: what listens at {address!r} has not answered as a Dask scheduler does "
            f"within {limit:g} s; see whether the address is right, and the scheduler is alive"
        ) from None
    if isinstance(found, (OSError, ValueError, TypeError, RuntimeError)):
        raise DynrespError(
            f"--scheduler: no Dask scheduler can be reached at {address!r} ({_short(found)}); "
            "start one with `dask scheduler`, and see docs/datasets.md for TLS"
        )
    if isinstance(found, Exception):
        raise found
    return found


def _await_workers(client: Client, address: str, waiting: Callable[[], None]) -> None:
    told = False
    while not _threads(client, address):
        if not told:
            waiting()
            told = True
        time.sleep(_LOOK_S)


def _threads(client: Client, address: str) -> int:
    """How many shards the cluster makes at once."""
    try:
        found: dict[str, int] = client.sync(client.scheduler.ncores, callback_timeout=_CONNECT_S)
    except Exception:
        raise _gone(address) from None
    return sum(found.values())


def _made(
    client: Client, job: Job, wanted: Sequence[Place], address: str
) -> Generator[tuple[Place, bytes], None, None]:
    from distributed import as_completed

    run = secrets.token_hex(4)
    flying: dict[Any, Place] = {}
    finished = as_completed(loop=client.loop)
    left = list(reversed(wanted))
    while left or flying:
        room = max(_LEAST, _AHEAD * _threads(client, address)) - len(flying)
        for _ in range(min(room, len(left))):
            place = left.pop()
            key = f"dynresp-{run}-{place.name}"
            # Earlier shards first, wherever they are.
            future = client.submit(
                make_on_worker, job, place, key=key, pure=False, priority=-place.number
            )
            flying[future] = place
            finished.add(future)
        future = next(finished)
        place = flying.pop(future)
        yield place, _result(future, place, address)


def _result(future: Any, place: Place, address: str) -> bytes:
    from distributed import KilledWorker

    try:
        data = future.result(timeout=_CONNECT_S)
    except DynrespError:
        raise
    except KilledWorker:
        raise DynrespError(
            f"the workers that were to make shard {place.number} died, one after the other; look "
            "into their logs (memory?). Nothing is lost: the same command goes on."
        ) from None
    except Exception as error:
        if future.status == "error":
            raise DynrespError(
                f"a worker failed on shard {place.number}: {_short(error)}; the same version of "
                "dynresp must be installed there"
            ) from None
        raise _gone(address) from None
    if not isinstance(data, bytes):
        raise DynrespError(f"a worker gave a {type(data).__name__} as shard {place.number}")
    return data


def make_on_worker(job: Job, place: Place) -> bytes:
    """Make one shard; what a Dask worker runs.

    Raises:
        DynrespError: It could not be done there.
    """
    try:
        return _workshop(job).make(place)
    except DynrespError as error:
        from distributed import get_worker

        # The root of the tree, since others may not survive the way back.
        raise DynrespError(f"worker {get_worker().address}: {error}") from None


def _workshop(job: Job) -> Workshop:
    key = (job.manifest["identity"], job.beside, job.motions)
    if getattr(_own, "key", None) != key:
        # A folder that is on this machine, or else what the machine itself is told.
        here = job.motions is not None and job.motions.is_dir()
        _own.workshop = load(job if here else replace(job, motions=None))
        _own.key = key
    workshop: Workshop = _own.workshop
    return workshop


def _gone(address: str) -> DynrespError:
    return DynrespError(
        f"the connection to the Dask scheduler at {address!r} is lost. What is made is kept: when "
        "the scheduler runs again, the same command goes on."
    )


def _short(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:200]}" if text else type(error).__name__
