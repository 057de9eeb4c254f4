"""Make a dataset in a new folder, or continue one that was interrupted."""

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

from dynresp.datasets.dataset_spec import DatasetSpec
from dynresp.datasets.local_workers import cores, make_locally
from dynresp.datasets.manifest import MANIFEST, differences, differences_text, write_manifest
from dynresp.datasets.manifest_reader import (
    MAX_SHARD_SIZE,
    Facts,
    ManifestError,
    parse_facts,
    read_manifest,
)
from dynresp.datasets.sample_worker import Job, SampleWorker
from dynresp.datasets.shard_schema import Columns
from dynresp.datasets.shards import (
    OtherDatasetError,
    ShardError,
    ShardRange,
    decode,
    leftover_files,
    read_shard,
    shard_files,
    shard_ranges,
    stated_ranges,
)
from dynresp.support.errors import DynrespError, UsageError
from dynresp.support.extras import require
from dynresp.support.files import replacing
from dynresp.support.paths import expanded
from dynresp.support.progress import Progress

SHARD_SIZE = 500
"""Samples of a shard by default: about ten seconds of work for one core."""


@dataclass
class Summary:
    """What a run has made.

    Attributes:
        folder: The dataset's folder.
        samples: In the dataset.
        outcomes: How many samples have which outcome.
        shards: In the dataset.
        made: Shards that were missing and that this run has made.
        remade: Damaged or too short shards that this run has replaced.
        samples_made: Samples in these.
        seconds: How long that took, including the start of the workers [s].
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
    spec: DatasetSpec,
    spec_folder: Path,
    out: Path,
    motions: Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    shard_size: int | None = None,
    progress: Progress | None = None,
    loaded: Callable[[Mapping[str, Any]], None] | None = None,
    *,
    overwrite: bool = False,
) -> Summary:
    """Make a dataset, or the missing part of it.

    The samples depend only on the spec, not on the workers or on interruptions.

    Args:
        spec: What the samples are drawn from.
        spec_folder: Folder of the spec file, from which relative paths count.
        out: Folder of the dataset; made if it is missing.
        motions: Motions folder that the user gave.
        workers: Processes on this machine; by default one per core.
        scheduler: Address of a Dask scheduler; its workers do the work instead.
        shard_size: Samples of a shard; by default what the folder has, else `SHARD_SIZE`.
        progress: Called with the stage, samples done, and samples in all.
        loaded: Called with the manifest before any sample is made.
        overwrite: Whether a manifest and shards may be replaced that no dataset of ours names.

    Raises:
        UsageError: The folder holds another dataset or more samples than the spec, or cannot be
            written; or the scheduler's address or certificates are wrong.
        MissingExtraError: PyArrow is not installed.
        DynrespError: It could not be done. Finished shards stay; the next run continues.
    """
    progress = progress or (lambda stage, done, of: None)
    require("pyarrow")
    if scheduler is not None:
        from dynresp.datasets.dask_workers import connection_security

        # Refused before motions are loaded, which takes a while.
        connection_security(scheduler)
    with _locked(out):
        progress("loading motions", 0, spec.plan.count)
        worker = SampleWorker(spec, spec_folder.resolve(), motions)
        manifest = worker.manifest(_shard_size(out, shard_size, worker))
        there = _checked(out, manifest)
        if there is None and not overwrite:
            _refuse_foreign(out)
        if loaded is not None:
            loaded(manifest)
        facts = parse_facts(manifest)
        summary = Summary(out, shards=-(-facts.count // facts.shard_size))
        if there is None:
            _refuse_fewer(out, facts)
        wanted = _wanted(out, facts, summary, progress, known=there is not None)
        for path in leftover_files(out):
            path.unlink(missing_ok=True)
        # Written before the shards, so that each of them belongs to a known dataset.
        if there != manifest:
            write_manifest(manifest, out)
        named = None if motions is None else expanded(motions, "--motions").resolve()
        job = Job(spec, spec_folder.resolve(), named, manifest)
        del worker
        _make(job, facts, wanted, out, workers, scheduler, summary, progress)
    return summary


def _make(
    job: Job,
    facts: Facts,
    wanted: Mapping[ShardRange, bool],
    out: Path,
    workers: int | None,
    scheduler: str | None,
    summary: Summary,
    progress: Progress,
) -> None:
    """Make shards, and write each as soon as it is finished."""
    if not wanted:
        return
    begun = time.perf_counter()
    kept = summary.samples
    stage = "labelling"

    def partly(done: int) -> None:
        progress(stage, kept + summary.samples_made + done, facts.count)

    with ExitStack() as stack:
        if scheduler is None:
            progress("starting workers", kept, facts.count)
            made = make_locally(job, list(wanted), workers or cores(), partly)
        else:
            from dynresp.datasets.dask_workers import make_on_cluster

            progress("looking for the scheduler", kept, facts.count)

            def waiting() -> None:
                progress("waiting for workers", kept, facts.count)

            made = make_on_cluster(job, list(wanted), scheduler, waiting)
        stack.enter_context(closing(made))
        for shard, data in made:
            source = f"shard {shard.number}, as it was made"
            columns = decode(data, facts.layout, shard, source)
            facts.check(columns, source)
            with replacing(out / shard.name) as temporary:
                temporary.write_bytes(data)
            _count(columns, facts, summary)
            summary.samples_made += shard.rows
            if wanted[shard]:
                summary.remade += 1
            else:
                summary.made += 1
            summary.seconds = time.perf_counter() - begun
            progress(stage, kept + summary.samples_made, facts.count)


def _wanted(
    out: Path, facts: Facts, summary: Summary, progress: Progress, known: bool
) -> dict[ShardRange, bool]:
    """The shards that must be made, and whether each replaces a bad one.

    Args:
        out: Folder of the dataset.
        facts: What its manifest says.
        summary: Counts the good shards.
        progress: Called with the stage, samples done, and samples in all.
        known: Whether the folder's manifest says that it holds this dataset; then a shard of
            another dataset is a bad one, too.
    """
    wanted = {}
    there = shard_files(out)
    ranges = shard_ranges(facts.identity, facts.count, facts.shard_size)
    beyond = [path.name for number, path in sorted(there.items()) if number >= len(ranges)]
    if beyond:
        raise UsageError(
            f"{out} holds more than {facts.count} samples ({beyond[0]}); give a larger --count, or "
            "another folder"
        )
    for shard in ranges:
        if shard.number not in there:
            wanted[shard] = False
            continue
        progress("checking what is there", shard.first, facts.count)
        try:
            columns = read_shard(out, facts.layout, shard)
            facts.check(columns, shard.name)
            _count(columns, facts, summary)
        except ShardError as error:
            if isinstance(error, OtherDatasetError) and not known:
                raise UsageError(
                    f"{error}; give another folder, or the --shard-size that it was made with, "
                    "or remove its shards"
                ) from None
            wanted[shard] = True
    return wanted


def _count(columns: Columns, facts: Facts, summary: Summary) -> None:
    counts = np.bincount(columns["outcome"], minlength=len(facts.outcomes))
    for name, number in zip(facts.outcomes, counts, strict=True):
        summary.outcomes[name] += int(number)
    summary.samples += len(columns["index"])


def _refuse_fewer(out: Path, facts: Facts) -> None:
    """Refuse fewer samples than the shards hold, where there is no manifest."""
    most = max(
        (p.first + p.rows for p in stated_ranges(out) if p.identity == facts.identity), default=0
    )
    if most > facts.count:
        raise _too_few_error(out, most, facts.count, "at least ")


def _too_few_error(out: Path, there: int, wanted: int, how: str = "") -> UsageError:
    return UsageError(
        f"{out} holds a dataset of {how}{there} samples, more than the {wanted} to make; give "
        f"--count {there} or more, or another folder"
    )


def _shard_size(out: Path, given: int | None, worker: SampleWorker) -> int:
    """The given shard size, or else that of the dataset in the folder."""
    if given is not None:
        return given
    try:
        return int(read_manifest(out)["shard_size"])
    except (ManifestError, UsageError):
        pass
    tried = set()
    for shard in stated_ranges(out):
        # The first shard alone does not say whether it is full. The identity depends on the size.
        sizes = (shard.first // shard.number,) if shard.number else (SHARD_SIZE, shard.rows)
        for size in sizes:
            if not 1 <= size <= MAX_SHARD_SIZE or (shard.identity, size) in tried:
                continue
            tried.add((shard.identity, size))
            if worker.manifest(size)["identity"] == shard.identity:
                return size
    return SHARD_SIZE


def _checked(out: Path, manifest: Mapping[str, Any]) -> dict[str, Any] | None:
    """The manifest in the folder, if any; another dataset, or a larger one, is refused."""
    if not (out / MANIFEST).exists():
        return None
    try:
        there = read_manifest(out)
    except ManifestError:
        # The shards themselves name their dataset; the manifest is written again.
        return None
    found = differences(there, manifest)
    if found:
        raise UsageError(
            f"{out} holds another dataset, with another {differences_text(found)}. Give another "
            "folder, or the spec and options that it was made with."
        )
    if there["count"] > manifest["count"]:
        raise _too_few_error(out, there["count"], manifest["count"])
    return there


def _refuse_foreign(out: Path) -> None:
    """Refuse files that a dataset would replace, where nothing says that they are a dataset's.

    A damaged manifest beside shards of ours is ours, too: it is made again.
    """
    foreign = [path.name for _, path in sorted(shard_files(out).items())]
    if (out / MANIFEST).exists():
        foreign.insert(0, MANIFEST)
    if foreign and not stated_ranges(out):
        more = f" and {len(foreign) - 3} more" if len(foreign) > 3 else ""
        raise UsageError(
            f"{out} holds {', '.join(foreign[:3])}{more}, which dynresp has not written; choose "
            "another folder, or allow to replace files (--overwrite, in Python overwrite=True)"
        )


@contextmanager
def _locked(out: Path) -> Iterator[None]:
    """Make the folder, and lock it against other runs.

    Folders that it has made are removed again if they stay empty.
    """
    if out.exists() and not out.is_dir():
        raise UsageError(f"--out: {str(out)!r} is a file; give a folder for the dataset")
    new = [folder for folder in (out, *out.parents) if not folder.exists()]
    try:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(
                f"--out: {str(out)!r} cannot be made ({error.strerror}); choose another folder"
            ) from None
        with _exclusive(out):
            yield
    finally:
        with suppress(OSError):
            for folder in new:
                folder.rmdir()


@contextmanager
def _exclusive(out: Path) -> Iterator[None]:
    if not os.access(out, os.W_OK | os.X_OK):
        raise UsageError(f"--out: {str(out)!r} cannot be written; choose another folder")
    try:
        import fcntl
    except ImportError:
        # A system without such locks: two runs write the same, and each file is whole.
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
