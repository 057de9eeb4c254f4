"""Archives of arrays: there and back, and refused before they take the memory they ask for."""

import tracemalloc
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from dynresp.support.archive import TEXT, ArchiveFormat, text_array
from dynresp.support.errors import UsageError

FORMAT = ArchiveFormat(
    what="sample",
    error=UsageError,
    version=1,
    members={
        "format_version": ("<i8", ()),
        "name": (TEXT, ()),
        "rows": ("<f8", ("rows", 8)),
        "more": ("<f8", ("rows", 8)),
    },
    most={"rows": 1 << 30},
    max_text=100,
    max_bytes=1 << 20,
)
# As many rows of 64 bytes as fit beside the headers, with another array of one row.
FITTING = (1 << 14) - 64


def arrays(rows: int, more: int = 1) -> dict[str, np.ndarray]:
    return {
        "name": text_array("a"),
        "rows": np.arange(8.0 * rows).reshape(rows, 8),
        "more": np.zeros((more, 8)),
    }


def deflated(path: Path, rows: Mapping[str, int]) -> Path:
    """A small file whose arrays unpack to many zeros."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in (("format_version", np.array(1)), ("name", text_array("a"))):
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, array, version=(1, 0))
        for name, count in rows.items():
            header = {"descr": "<f8", "fortran_order": False, "shape": (count, 8)}
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array_header_1_0(member, header)
                for _ in range(count // 1024):
                    member.write(bytes(64 * 1024))
    return path


@pytest.mark.parametrize("rows", [0, 3, FITTING])
def test_there_and_back(tmp_path: Path, rows: int) -> None:
    path = tmp_path / "sample.npz"
    FORMAT.write(path, arrays(rows))
    read = FORMAT.read(path)
    assert read["name"].item() == "a"
    np.testing.assert_array_equal(read["rows"], arrays(rows)["rows"])


@pytest.mark.parametrize("rows", [{"rows": 1 << 18, "more": 0}, {"rows": 1 << 13, "more": 1 << 13}])
def test_what_unpacks_to_too_much_is_refused_unread(tmp_path: Path, rows: dict[str, int]) -> None:
    path = deflated(tmp_path / "sample.npz", rows)
    assert path.stat().st_size < 1 << 16
    tracemalloc.start()
    with pytest.raises(UsageError, match=r"unpacks to [\d.]+ MiB, .* at most 1 MiB"):
        FORMAT.read(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1 << 19


def test_deflated_arrays_that_fit_are_read(tmp_path: Path) -> None:
    path = deflated(tmp_path / "sample.npz", {"rows": 1 << 13, "more": 1 << 12})
    read = FORMAT.read(path)
    assert read["rows"].shape == (1 << 13, 8)
    assert not read["more"].any()


@pytest.mark.parametrize(("rows", "more"), [(1 << 14, 1), (1 << 13, 1 << 13)])
def test_what_could_not_be_read_is_not_written(tmp_path: Path, rows: int, more: int) -> None:
    path = tmp_path / "sample.npz"
    FORMAT.write(path, arrays(1))
    before = path.read_bytes()
    with pytest.raises(UsageError, match="is larger than 1 MiB; cut the sample"):
        FORMAT.write(path, arrays(rows, more))
    assert path.read_bytes() == before
