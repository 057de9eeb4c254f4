"""Making a dataset: into a new folder, or going on in one that has been begun."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.datasets.dataset_spec import DatasetPlan
from dynresp.datasets.local_workers import cores, make_here
from dynresp.datasets.manifest import MANIFEST, differences, told, write_manifest
from dynresp.datasets.manifest_reader import (
    MAX_SHARD_SIZE,
    Facts,
    ManifestError,
    parse_facts,
    read_manifest,
)
from dynresp.datasets.sample_worker import Job, Workshop
from dynresp.datasets.shard_schema import Columns
from dynresp.datasets.shards import (
    ForeignShardError,
    Place,
    ShardError,
    decode,
    left_over,
    places,
    read_shard,
    shard_files,
    stated,
)
from dynresp.support.errors import DynrespError, UsageError
from dynresp.support.extras import require
from dynresp.support.files import replacing
from dynresp.support.paths import expanded
from dynresp.support.progress import Progress

SHARD_SIZE = 500
"""Samples of a shard where nothing else is said: about ten seconds of one core."""


@dataclass
class Summary:
    """What a run has come to.

    Attributes:
        folder: The dataset's folder.
        samples: In the dataset.
        outcomes: How many samples have which outcome.
        shards: In the dataset.
        made: Shards that this run has made where there was none.
        remade: Shards that it has made in place of one that was damaged or too short.
        samples_made: Samples in these.
        seconds: How long that took, with the starting of workers [s].
    """

    folder: Path
    samples: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    shards: int = 0
    made: int = 0
    remade: int = 0
    samples_made: int = 0
    seconds: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """The same as one JSON object."""
        rate = self.samples_made / self.seconds if self.samples_made else None
        return {
            "folder": str(self.folder),
            "samples": self.samples,
            "hits": self.outcomes["hit"],
            "misses": self.outcomes["miss"],
            "diverged": self.outcomes["diverged"],
            "shards": self.shards,
            "shards_made": self.made,
            "shards_remade": self.remade,
            "samples_made": self.samples_made,
            "seconds": round(self.seconds, 3),
            "samples_per_s": None if rate is None else round(rate, 3),
        }


def generate(
    plan: DatasetPlan,
    beside: Path,
    out: Path,
    motions: Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    shard_size: int | None = None,
    tell: Progress | None = None,
    loaded: Callable[[Mapping[str, Any]], None] | None = None,
) -> Summary:
    """Make a dataset, or what is still missing of it.

    The samples depend on the plan alone: not on the workers, nor on how often it was interrupted.

    Args:
        plan: The plan.
        beside: Folder of the plan file, from which relative paths count.
        out: Folder of the dataset; made if it is missing.
        motions: Motions folder that the user named.
        workers: Processes on this machine, by default one for each core.
        scheduler: Address of a Dask scheduler whose workers do it instead.
        shard_size: Samples of a shard; by default what the folder has, else `SHARD_SIZE`.
        tell: Told how it goes on.
        loaded: Told the manifest, before anything is made.

    Raises:
        UsageError: The folder holds another dataset, more samples than asked for, or cannot be
            written; or the scheduler's address or certificates are wrong.
        MissingExtraError: PyArrow is not installed.
        DynrespError: It could not be done. What has been made stays, and is gone on with.
    """
    tell = tell or (lambda stage, done, of: None)
    require("pyarrow")
    if scheduler is not None:
        from dynresp.datasets.dask_workers import connection_security

        # Refused before motions are loaded, which takes a while.
        connection_security(scheduler)
    with _locked(out):
        tell("loading motions", 0, plan.plan.count)
        workshop = Workshop(plan, beside.resolve(), motions)
        manifest = workshop.manifest(_shard_size(out, shard_size, workshop))
        there = _checked(out, manifest)
        if loaded is not None:
            loaded(manifest)
        facts = parse_facts(manifest)
        summary = Summary(out, shards=-(-facts.count // facts.shard_size))
        if there is None:
            _refuse_fewer(out, facts)
        wanted = _wanted(out, facts, summary, tell, known=there is not None)
        for path in left_over(out):
            path.unlink(missing_ok=True)
        # First of all, so that whatever is made is known to belong to it.
        if there != manifest:
            write_manifest(manifest, out)
        named = None if motions is None else expanded(motions, "--motions").resolve()
        job = Job(plan, beside.resolve(), named, manifest)
        del workshop
        _make(job, facts, wanted, out, workers, scheduler, summary, tell)
    return summary


def _make(
    job: Job,
    facts: Facts,
    wanted: Mapping[Place, bool],
    out: Path,
    workers: int | None,
    scheduler: str | None,
    summary: Summary,
    tell: Progress,
) -> None:
    """Make shards, and write each as soon as it is there."""
    if not wanted:
        return
    begun = time.perf_counter()
    kept = summary.samples
    stage = "labelling"

    def partly(done: int) -> None:
        tell(stage, kept + summary.samples_made + done, facts.count)

    with ExitStack() as stack:
        if scheduler is None:
            tell("starting workers", kept, facts.count)
            made = make_here(job, list(wanted), workers or cores(), partly)
        else:
            from dynresp.datasets.dask_workers import make_there

            tell("looking for the scheduler", kept, facts.count)

            def waiting() -> None:
                tell("waiting for workers", kept, facts.count)

            made = make_there(job, list(wanted), scheduler, waiting)
        stack.enter_context(closing(made))
        for place, data in made:
            source = f"shard {place.number}, as it was made"
            columns = decode(data, facts.layout, place, source)
            facts.check(columns, source)
            with replacing(out / place.name) as temporary:
                temporary.write_bytes(data)
            _count(columns, facts, summary)
            summary.samples_made += place.rows
            if wanted[place]:
                summary.remade += 1
            else:
                summary.made += 1
            summary.seconds = time.perf_counter() - begun
            tell(stage, kept + summary.samples_made, facts.count)


def _wanted(
    out: Path, facts: Facts, summary: Summary, tell: Progress, known: bool
) -> dict[Place, bool]:
    """The shards that must be made, and whether each takes the place of a bad one.

    Where it is known from its manifest that the folder is this dataset's, a shard of another one
    is a bad one, too.
    """
    wanted = {}
    there = shard_files(out)
    all_places = places(facts.identity, facts.count, facts.shard_size)
    beyond = [path.name for number, path in sorted(there.items()) if number >= len(all_places)]
    if beyond:
        raise UsageError(
            f"{out} holds more than the {facts.count} samples that were asked for ({beyond[0]}); "
            "ask for as many as it has, or name another folder"
        )
    for place in all_places:
        if place.number not in there:
            wanted[place] = False
            continue
        tell("checking what is there", place.first, facts.count)
        try:
            columns = read_shard(out, facts.layout, place)
            facts.check(columns, place.name)
            _count(columns, facts, summary)
        except ShardError as error:
            if isinstance(error, ForeignShardError) and not known:
                raise UsageError(
                    f"{error}; name another folder, give the --shard-size that it was made with, "
                    "or remove its shards"
                ) from None
            wanted[place] = True
    return wanted


def _count(columns: Columns, facts: Facts, summary: Summary) -> None:
    counts = np.bincount(columns["outcome"], minlength=len(facts.outcomes))
    for name, number in zip(facts.outcomes, counts, strict=True):
        summary.outcomes[name] += int(number)
    summary.samples += len(columns["index"])


def _refuse_fewer(out: Path, facts: Facts) -> None:
    """Refuse fewer samples than there are where no manifest says how many: the shards do."""
    most = max((p.first + p.rows for p in stated(out) if p.identity == facts.identity), default=0)
    if most > facts.count:
        raise _fewer(out, most, facts.count, "at least ")


def _fewer(out: Path, there: int, asked: int, how: str = "") -> UsageError:
    return UsageError(
        f"{out} holds a dataset of {how}{there} samples, and {asked} were asked for; give --count "
        f"{there} or more, or name another folder"
    )


def _shard_size(out: Path, asked: int | None, workshop: Workshop) -> int:
    """The size that a begun dataset has, or the one that is asked for."""
    if asked is not None:
        return asked
    try:
        return int(read_manifest(out)["shard_size"])
    except (ManifestError, UsageError):
        pass
    tried = set()
    for place in stated(out):
        # Of the first shard alone it cannot be said whether it is full; the identity, in which
        # the size is, decides.
        sizes = (place.first // place.number,) if place.number else (SHARD_SIZE, place.rows)
        for size in sizes:
            if not 1 <= size <= MAX_SHARD_SIZE or (place.identity, size) in tried:
                continue
            tried.add((place.identity, size))
            if workshop.manifest(size)["identity"] == place.identity:
                return size
    return SHARD_SIZE


def _checked(out: Path, manifest: Mapping[str, Any]) -> dict[str, Any] | None:
    """The manifest that is there, if any; a folder with another dataset, or more, is refused."""
    if not (out / MANIFEST).exists():
        return None
    try:
        there = read_manifest(out)
    except ManifestError:
        # The shards themselves say what they belong to; the manifest is written again.
        return None
    found = differences(there, manifest)
    if found:
        raise UsageError(
            f"{out} holds another dataset; different are {told(found)}. Name another folder, or "
            "give what it was made with."
        )
    if there["count"] > manifest["count"]:
        raise _fewer(out, there["count"], manifest["count"])
    return there


@contextmanager
def _locked(out: Path) -> Iterator[None]:
    """Make the folder, and keep others from writing to it at the same time.

    Folders that it has made go again where nothing was put into them.
    """
    if out.exists() and not out.is_dir():
        raise UsageError(f"--out: {str(out)!r} is a file; expected a folder for the dataset")
    new = [folder for folder in (out, *out.parents) if not folder.exists()]
    try:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(
                f"--out: {str(out)!r} cannot be made ({error.strerror}); choose another folder"
            ) from None
        with _alone(out):
            yield
    finally:
        with suppress(OSError):
            for folder in new:
                folder.rmdir()


@contextmanager
def _alone(out: Path) -> Iterator[None]:
    if not os.access(out, os.W_OK | os.X_OK):
        raise UsageError(f"--out: {str(out)!r} cannot be written; choose another folder")
    try:
        import fcntl
    except ImportError:
        # A system without such locks: what two runs write is the same, and each file whole.
        yield
        return
    handle = os.open(out, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise DynrespError(
                f"--out: another `dynresp generate` is writing to {str(out)!r}; wait for it"
            ) from None
        except OSError:
            # A network file system that cannot lock a folder.
            pass
        yield
    finally:
        with suppress(OSError):
            os.close(handle)
