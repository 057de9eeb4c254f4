"""Shards: Parquet files of a fixed number of samples, each with a hash of its content.

The metadata of a shard hold its dataset, its number and the hash of its content. So a shard that is
damaged, cut off, of another dataset or under a wrong name is found without a second file, also
after a program was killed.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from dynresp.datasets.shard_schema import Column, Columns, arrow_schema
from dynresp.support.errors import DynrespError
from dynresp.support.extras import require

_KEY = b"dynresp"
_NAME = re.compile(r"shard-(\d{5,})\.parquet")
_LEFT_OVER = re.compile(r"\.(?:shard-\d{5,}|manifest)-[0-9a-f]{12}\.(?:parquet|json)")
# Beside its numbers a file holds its schema and, for every column, a few hundred bytes.
_OVERHEAD_BYTES = 1 << 20


class ShardError(DynrespError):
    """A shard that cannot be used; the message names the file and says why."""


class OtherDatasetError(ShardError):
    """An undamaged shard of another dataset."""


@dataclass(frozen=True)
class ShardRange:
    """Which samples a shard holds.

    Attributes:
        identity: Of its dataset.
        number: Which shard, from 0.
        first: Index of its first sample.
        rows: How many samples it holds.
    """

    identity: str
    number: int
    first: int
    rows: int

    @property
    def name(self) -> str:
        """Name of its file."""
        return f"shard-{self.number:05d}.parquet"


def shard_ranges(identity: str, count: int, size: int) -> list[ShardRange]:
    """All shards of a dataset.

    Args:
        identity: Of the dataset.
        count: How many samples it has.
        size: How many samples a shard has; the last may have fewer.
    """
    starts = range(0, count, size)
    return [ShardRange(identity, n, at, min(size, count - at)) for n, at in enumerate(starts)]


def shard_files(folder: Path) -> dict[int, Path]:
    """Files in a folder with names of shards, by number."""
    found = {}
    for path in folder.iterdir():
        match = _NAME.fullmatch(path.name)
        if match and path.name == f"shard-{int(match[1]):05d}.parquet":
            found[int(match[1])] = path
    return found


def leftover_files(folder: Path) -> list[Path]:
    """Half-written files under temporary names, left by a killed program."""
    return sorted(path for path in folder.iterdir() if _LEFT_OVER.fullmatch(path.name))


def stated_ranges(folder: Path) -> list[ShardRange]:
    """What the metadata of the shards in a folder say, without reading the samples.

    Shards with damaged metadata are left out.
    """
    require("pyarrow")
    import pyarrow as pa
    import pyarrow.parquet as pq

    found = []
    for number, path in sorted(shard_files(folder).items()):
        try:
            about = _about(pq.read_schema(path).metadata, path.name)
        except (ShardError, pa.ArrowException, OSError, ValueError, MemoryError):
            continue
        identity, first, rows = (about.get(key) for key in ("dataset", "first", "rows"))
        if about.get("shard") != number or not isinstance(identity, str):
            continue
        if isinstance(first, int) and isinstance(rows, int):
            found.append(ShardRange(identity, number, first, rows))
    return found


def encode(columns: Columns, layout: Sequence[Column], shard: ShardRange) -> bytes:
    """A shard as a Parquet file; the same contents give the same bytes.

    Args:
        columns: Its arrays, of the types and shapes of the layout.
        layout: Its columns.
        shard: Which shard it is.
    """
    require("pyarrow")
    import pyarrow as pa
    import pyarrow.parquet as pq

    arrays = []
    schema = arrow_schema(layout)
    for column, field in zip(layout, schema, strict=True):
        flat = pa.array(columns[column.name].reshape(-1))
        lists = pa.FixedSizeListArray.from_arrays
        arrays.append(lists(flat, type=field.type) if column.width else flat)
    about = {
        "dataset": shard.identity,
        "shard": shard.number,
        "first": shard.first,
        "rows": shard.rows,
        "sha256": _hash(columns, layout),
    }
    schema = schema.with_metadata({_KEY: json.dumps(about).encode()})
    sink = pa.BufferOutputStream()
    floats = [f"{c.name}.list.element" if c.width else c.name for c in layout if c.dtype[1] == "f"]
    pq.write_table(
        pa.Table.from_arrays(arrays, schema=schema),
        sink,
        row_group_size=max(shard.rows, 1),
        compression="zstd",
        use_dictionary=False,
        use_byte_stream_split=floats,
        write_statistics=False,
    )
    return sink.getvalue().to_pybytes()


def decode(data: bytes, layout: Sequence[Column], shard: ShardRange, source: str) -> Columns:
    """The arrays of a shard, checked.

    Args:
        data: The Parquet file.
        layout: The columns that it must have.
        shard: Which shard it must be.
        source: Its name, for messages.

    Raises:
        OtherDatasetError: It is a shard of another dataset.
        ShardError: It is damaged, or another shard than it must be.
    """
    require("pyarrow")
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(pa.BufferReader(data))
        about = _about(file.schema_arrow.metadata, source)
        _check_range(about, shard, source)
        if not file.schema_arrow.equals(arrow_schema(layout), check_metadata=False):
            raise ShardError(f"{source}: its columns are not those of its dataset")
        _check_size(file.metadata, layout, shard, source)
        table = file.read(use_threads=False)
        columns = {column.name: _array(table, column, shard.rows) for column in layout}
    # Arrow's own errors are ValueError, OSError, KeyError, MemoryError and NotImplementedError.
    except (ValueError, OSError, LookupError, MemoryError, NotImplementedError, TypeError) as error:
        raise ShardError(f"{source}: damaged ({_error_text(error)})") from None
    if _hash(columns, layout) != about["sha256"]:
        raise ShardError(f"{source}: damaged (its content does not match its hash)")
    if not np.array_equal(columns["index"], np.arange(shard.first, shard.first + shard.rows)):
        raise ShardError(f"{source}: damaged (its samples are not in order)")
    return columns


def read_shard(folder: Path, layout: Sequence[Column], shard: ShardRange) -> Columns:
    """Read a shard's file.

    Raises:
        OtherDatasetError: It is a shard of another dataset.
        ShardError: It is missing, damaged, or another shard than it must be.
    """
    path = folder / shard.name
    most = _bytes(layout, shard.rows) + _OVERHEAD_BYTES
    try:
        with path.open("rb") as file:
            data = file.read(most + 1)
    except FileNotFoundError:
        raise ShardError(f"{path}: missing") from None
    except OSError as error:
        raise ShardError(f"{path}: cannot be read ({error.strerror})") from None
    if len(data) > most:
        raise ShardError(f"{path}: damaged (larger than {most} bytes)")
    return decode(data, layout, shard, str(path))


def _about(metadata: Mapping[bytes, bytes] | None, source: str) -> dict[str, Any]:
    try:
        about = json.loads((metadata or {})[_KEY])
    except (KeyError, ValueError, RecursionError):
        raise ShardError(f"{source}: damaged (no metadata of dynresp)") from None
    if not isinstance(about, dict):
        raise ShardError(f"{source}: damaged (no metadata of dynresp)")
    return about


def _check_range(about: Mapping[str, Any], shard: ShardRange, source: str) -> None:
    if about.get("dataset") != shard.identity:
        raise OtherDatasetError(f"{source}: a shard of another dataset")
    wanted = {"shard": shard.number, "first": shard.first, "rows": shard.rows}
    for key, value in wanted.items():
        if about.get(key) != value:
            raise ShardError(f"{source}: expected {key} {value}, it has {about.get(key)!r}")
    if not isinstance(about.get("sha256"), str):
        raise ShardError(f"{source}: damaged (no hash)")


def _check_size(metadata: Any, layout: Sequence[Column], shard: ShardRange, source: str) -> None:
    """Refuse a file that claims an impossible size, before it is decompressed."""
    if metadata.num_rows != shard.rows or metadata.num_row_groups != 1:
        raise ShardError(
            f"{source}: damaged (expected {shard.rows} rows in one group, got "
            f"{metadata.num_rows} in {metadata.num_row_groups})"
        )
    group = metadata.row_group(0)
    claimed = sum(group.column(i).total_uncompressed_size for i in range(group.num_columns))
    if not 0 <= claimed <= _bytes(layout, shard.rows) + _OVERHEAD_BYTES:
        raise ShardError(f"{source}: damaged (it claims {claimed} bytes decompressed)")


def _bytes(layout: Sequence[Column], rows: int) -> int:
    """Size of the numbers of some rows [bytes], and a byte each for Parquet's list levels."""
    return rows * sum((np.dtype(c.dtype).itemsize + 1) * max(c.width, 1) for c in layout)


def _array(table: Any, column: Column, rows: int) -> npt.NDArray[Any]:
    cells = table.column(column.name).combine_chunks()
    if cells.null_count:
        raise ValueError(f"{column.name} has nulls")
    numbers = cells.flatten() if column.width else cells
    found = numbers.to_numpy(zero_copy_only=False).astype(column.dtype, copy=False)
    return found.reshape(column.shape(rows))


def _hash(columns: Columns, layout: Sequence[Column]) -> str:
    """SHA-256 of all names, types and numbers; the same on every machine."""
    digest = hashlib.sha256()
    for column in layout:
        array = np.ascontiguousarray(columns[column.name], dtype=column.dtype)
        digest.update(f"{column.name} {column.dtype} {array.shape}\n".encode())
        digest.update(array.data)
    return digest.hexdigest()


def _error_text(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return text[:200] if text else type(error).__name__
