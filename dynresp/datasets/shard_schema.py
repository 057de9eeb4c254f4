"""The columns of a shard; `docs/datasets.md` explains them to users."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from dynresp.datasets.dataset_spec import KINDS
from dynresp.datasets.sample_draws import Sample
from dynresp.motion.character import Character
from dynresp.support.extras import require

if TYPE_CHECKING:
    import pyarrow as pa

    from dynresp.response.search.hit_labels import HitLabels

SCHEMA_VERSION = 1
"""Increases with every change of the columns or of their meaning."""

MAX_WIDTH = 100_000
"""Most numbers in one cell."""

Columns: TypeAlias = dict[str, npt.NDArray[Any]]
"""Arrays by column name, their first axis the samples."""


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes:
        name: Its name in the Parquet file.
        dtype: Of its numbers, little-endian, as NumPy writes it.
        width: How many numbers a cell holds; 0 where it is a number, not a list.
    """

    name: str
    dtype: str
    width: int = 0

    def shape(self, rows: int) -> tuple[int, ...]:
        """Shape of its array."""
        return (rows, self.width) if self.width else (rows,)


PARAMETERS = (
    "phase",
    "time_s",
    "from_deg",
    "elevation_deg",
    "mass_kg",
    "radius_m",
    "speed_m_s",
    "height_m",
    "offset_m",
    "force_n",
    "duration_s",
)
"""Numbers of an impact, in the units of their names; NaN where its kind has no such number."""


def columns(features: int, classes: int) -> tuple[Column, ...]:
    """All columns, in the order of the file.

    Args:
        features: How many features a sample has.
        classes: How many classes there are.
    """
    return (
        Column("index", "<i8"),
        Column("base", "<i2"),
        Column("impact", "<i2"),
        Column("kind", "|i1"),
        *(Column(name, "<f8") for name in PARAMETERS),
        Column("target", "|i1"),
        Column("outcome", "|i1"),
        Column("contact_time_s", "<f8"),
        Column("contact_frame", "<i4"),
        Column("contact_body", "|i1"),
        Column("contact_force", "<f4"),
        Column("contact_point", "<f4", 3),
        Column("graze", "|b1"),
        Column("speed_change", "<f4"),
        Column("label", "<i2"),
        Column("errors", "<f4", classes),
        Column("exit_frames", "<i2", classes),
        Column("entry_frames", "<i2", classes),
        Column("features", "<f4", features),
    )


def arrow_schema(layout: Sequence[Column]) -> pa.Schema:
    """The columns as an Arrow schema: several numbers are a list of fixed size; nothing is null."""
    require("pyarrow")
    import pyarrow as pa

    fields = []
    for column in layout:
        number = pa.from_numpy_dtype(np.dtype(column.dtype))
        kind = pa.list_(pa.field("element", number, nullable=False), column.width)
        fields.append(pa.field(column.name, kind if column.width else number, nullable=False))
    return pa.schema(fields)


def drawn(samples: Sequence[Sample], character: Character) -> Columns:
    """Columns of what was drawn."""
    found: Columns = {
        "index": np.array([s.index for s in samples], dtype="<i8"),
        "base": np.array([s.base for s in samples], dtype="<i2"),
        "impact": np.array([s.table for s in samples], dtype="<i2"),
        "kind": np.array([KINDS.index(s.values["kind"]) for s in samples], dtype="|i1"),
        "target": np.array([character.body(s.values["target"]) for s in samples], dtype="|i1"),
    }
    for name in PARAMETERS:
        values = [s.phase if name == "phase" else s.values.get(name) for s in samples]
        found[name] = np.array([np.nan if v is None else v for v in values], dtype="<f8")
    return found


def labelled(result: HitLabels) -> Columns:
    """Columns of what the hits did."""
    names = (
        "outcome", "contact_time_s", "contact_frame", "contact_body", "contact_force",
        "contact_point", "graze", "speed_change", "label", "errors", "exit_frames",
        "entry_frames", "features",
    )  # fmt: skip
    return {name: getattr(result, name) for name in names}


def joined(parts: Sequence[Mapping[str, npt.NDArray[Any]]], layout: Sequence[Column]) -> Columns:
    """Concatenate rows; each column gets its type in the file."""
    return {
        column.name: np.concatenate([part[column.name] for part in parts]).astype(column.dtype)
        for column in layout
    }
