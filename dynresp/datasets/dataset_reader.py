"""Read a dataset that `dynresp generate` has written."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from dynresp.datasets.manifest_reader import HIT, Facts, parse_facts, read_manifest
from dynresp.datasets.shard_schema import PARAMETERS, Columns
from dynresp.datasets.shards import ShardError, ShardRange, read_shard, shard_ranges
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import DynrespError, UsageError

_THREADS = 4


@dataclass(frozen=True)
class Dataset:
    """Samples, as read-only arrays of length n. A miss has NaN, and -1 for an index.

    Attributes:
        facts: What the manifest says: names, identities, settings.
        index: (n,) the sample's number in the dataset.
        base: (n,) which base motion was hit, in `facts.bases`.
        impact: (n,) which `[[impact]]` of the spec it was drawn from.
        kind: (n,) in `facts.kinds`.
        target: (n,) the body aimed at, in `facts.bodies`.
        parameters: By name, such as "speed_m_s", (n,) numbers of the impact in the units of their
            names; NaN where its kind has no such number. `time_s` counts from the start of the
            base motion.
        outcome: (n,) in `facts.outcomes`.
        contact_time_s: (n,) from the base motion's start [s].
        contact_frame: (n,) first frame at or after contact, in the base motion.
        contact_body: (n,) the body hit, in `facts.bodies`.
        contact_force: (n,) [N].
        contact_point: (n, 3) world [m].
        graze: (n,) whether the hit was too light for a reaction.
        speed_change: (n,) change of the horizontal speed of the centre of mass [m/s].
        label: (n,) class that the full search chose, in `facts.classes`.
        errors: (n, classes) least mismatch (window error) of each class [m].
        exit_frames: (n, classes) exit with that mismatch, frames after contact.
        entry_frames: (n, classes) frame of the reaction's clip; of the base motion, after contact.
        features: (n, features) in the order of `facts.feature_names`.
    """

    facts: Facts
    index: npt.NDArray[np.int64]
    base: npt.NDArray[np.int16]
    impact: npt.NDArray[np.int16]
    kind: npt.NDArray[np.int8]
    target: npt.NDArray[np.int8]
    parameters: Mapping[str, FloatArray]
    outcome: npt.NDArray[np.int8]
    contact_time_s: npt.NDArray[np.float64]
    contact_frame: npt.NDArray[np.int32]
    contact_body: npt.NDArray[np.int8]
    contact_force: npt.NDArray[np.float32]
    contact_point: npt.NDArray[np.float32]
    graze: npt.NDArray[np.bool_]
    speed_change: npt.NDArray[np.float32]
    label: npt.NDArray[np.int16]
    errors: npt.NDArray[np.float32]
    exit_frames: npt.NDArray[np.int16]
    entry_frames: npt.NDArray[np.int16]
    features: npt.NDArray[np.float32]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for array in (*self._arrays().values(), *self.parameters.values()):
            array.flags.writeable = False

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.index)

    def take(self, rows: npt.NDArray[np.intp] | npt.NDArray[np.bool_] | slice) -> Dataset:
        """Some of the samples.

        Args:
            rows: Which, as an index of NumPy: row numbers, a mask, or a slice.
        """
        taken = {name: array[rows] for name, array in self._arrays().items()}
        parameters = {name: array[rows] for name, array in self.parameters.items()}
        return replace(self, **taken, parameters=parameters)  # type: ignore[arg-type]

    def _arrays(self) -> dict[str, npt.NDArray[np.generic]]:
        names = [item.name for item in fields(self) if item.name not in ("facts", "parameters")]
        return {name: getattr(self, name) for name in names}


def load_dataset(
    folder: Path | str, *, hits_only: bool = False, limit: int | None = None
) -> Dataset:
    """Read a dataset, every shard checked by its hash.

    Args:
        folder: Of the dataset.
        hits_only: Leave out misses and simulations that diverged.
        limit: Read only the first samples, this many, misses included.

    Raises:
        UsageError: The folder holds no dataset, or one of another schema version; or the limit is
            below 1.
        DynrespError: A file is missing or damaged; the message names it.
    """
    folder = Path(folder)
    facts = parse_facts(read_manifest(folder), str(folder))
    if limit is not None and limit < 1:
        raise UsageError(f"limit: expected at least 1 sample, got {limit}")
    count = facts.count if limit is None else min(limit, facts.count)
    hit = facts.outcomes.index(HIT)
    wanted = [
        p for p in shard_ranges(facts.identity, facts.count, facts.shard_size) if p.first < count
    ]

    def part_of(shard: ShardRange) -> Columns:
        part = _read(folder, facts, shard)
        keep = part["index"] < count
        if hits_only:
            keep &= part["outcome"] == hit
        return part if keep.all() else {name: part[name][keep] for name in part}

    # Decoding and hashing release the GIL.
    with ThreadPoolExecutor(_THREADS) as pool:
        parts = list(pool.map(part_of, wanted))
    # Each part is dropped once it is copied, to save memory.
    joined = {
        column.name: np.concatenate([p.pop(column.name) for p in parts]) for column in facts.layout
    }
    parameters = {name: joined.pop(name) for name in PARAMETERS}
    return Dataset(facts=facts, parameters=parameters, **joined)


def _read(folder: Path, facts: Facts, shard: ShardRange) -> Columns:
    try:
        part = read_shard(folder, facts.layout, shard)
        facts.check(part, str(folder / shard.name))
    except ShardError as error:
        raise DynrespError(
            f"{error}; run the `dynresp generate` command that made the dataset again: it makes "
            "missing and damaged shards"
        ) from None
    return part
