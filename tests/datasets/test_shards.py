import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynresp.datasets.shard_schema import columns
from dynresp.datasets.shards import (
    OtherDatasetError,
    ShardError,
    ShardRange,
    decode,
    encode,
    leftover_files,
    read_shard,
    shard_files,
    shard_ranges,
)

from .samples import LAYOUT, made_up

PLACE = ShardRange("abc", 2, 14, 7)
DATA = encode(made_up(7, 14), LAYOUT, PLACE)


def test_what_is_written_is_read() -> None:
    contents = made_up(7, 14)
    found = decode(DATA, LAYOUT, PLACE, "x")
    assert list(found) == [column.name for column in LAYOUT]
    for name, array in contents.items():
        assert found[name].dtype == array.dtype
        # Bit by bit: NaN and -0 included.
        assert found[name].tobytes() == array.tobytes()


def test_the_same_contents_give_the_same_bytes() -> None:
    assert encode(made_up(7, 14), LAYOUT, PLACE) == DATA


def test_others_can_read_the_file() -> None:
    table = pq.read_table(pa.BufferReader(DATA))
    assert table.num_rows == 7
    assert table.column("index").to_pylist() == list(range(14, 21))
    assert table.schema.field("features").type.list_size == 5
    assert table.schema.field("features").type.value_type == pa.float32()
    about = json.loads(table.schema.metadata[b"dynresp"])
    assert (about["dataset"], about["shard"], about["first"]) == ("abc", 2, 14)


@pytest.mark.parametrize(("count", "size"), [(1, 500), (500, 500), (501, 500), (20, 8)])
def test_places_cover_all_samples_once(count: int, size: int) -> None:
    found = shard_ranges("abc", count, size)
    assert [i for p in found for i in range(p.first, p.first + p.rows)] == list(range(count))
    assert [p.number for p in found] == list(range(len(found)))
    assert all(p.rows == size for p in found[:-1])


@pytest.mark.parametrize(
    ("place", "message"),
    [
        (replace(PLACE, number=3), "expected shard 3, it has 2"),
        (replace(PLACE, first=7), "expected first 7, it has 14"),
        (replace(PLACE, rows=8), "expected rows 8, it has 7"),
    ],
)
def test_another_shard_gives_itself_away(place: ShardRange, message: str) -> None:
    with pytest.raises(ShardError, match=f"file: {message}"):
        decode(DATA, LAYOUT, place, "file")


def test_a_shard_of_another_dataset_differs_from_a_damaged_one() -> None:
    with pytest.raises(OtherDatasetError, match="file: a shard of another dataset"):
        decode(DATA, LAYOUT, replace(PLACE, identity="xyz"), "file")


@given(at=st.integers(0, len(DATA) - 1), mask=st.integers(1, 255))
def test_a_changed_byte_is_noticed_or_changes_nothing(at: int, mask: int) -> None:
    damaged = bytearray(DATA)
    damaged[at] ^= mask
    _check_damaged(bytes(damaged))


@given(length=st.integers(0, len(DATA) - 1))
def test_a_shard_that_is_cut_off_is_noticed(length: int) -> None:
    with pytest.raises(ShardError, match="file: damaged"):
        decode(DATA[:length], LAYOUT, PLACE, "file")


@given(junk=st.binary(max_size=200))
def test_junk_is_no_shard(junk: bytes) -> None:
    with pytest.raises(ShardError, match="file: damaged"):
        decode(b"PAR1" + junk + b"PAR1", LAYOUT, PLACE, "file")


def _check_damaged(data: bytes) -> None:
    """Either the damage is noticed, or every number is as it was."""
    with suppress(ShardError):
        found = decode(data, LAYOUT, PLACE, "file")
        for name, array in made_up(7, 14).items():
            assert found[name].tobytes() == array.tobytes()


def test_a_plain_table_is_no_shard() -> None:
    sink = pa.BufferOutputStream()
    pq.write_table(pa.table({"index": [1, 2]}), sink)
    with pytest.raises(ShardError, match="no metadata of dynresp"):
        decode(sink.getvalue().to_pybytes(), LAYOUT, PLACE, "file")


def test_other_columns_are_noticed() -> None:
    with pytest.raises(ShardError, match="its columns are not those of its dataset"):
        decode(DATA, columns(6, 3), PLACE, "file")


def test_samples_out_of_order_are_noticed() -> None:
    contents = made_up(7, 14)
    contents["index"] = contents["index"][::-1].copy()
    with pytest.raises(ShardError, match="not in order"):
        decode(encode(contents, LAYOUT, PLACE), LAYOUT, PLACE, "file")


def test_files_of_a_folder(tmp_path: Path) -> None:
    (tmp_path / PLACE.name).write_bytes(DATA)
    names = ("shard-123456.parquet", "shard-000002.parquet", "shard-1.parquet", "x.parquet")
    temporary = (".shard-00002-0123456789ab.parquet", ".manifest-0123456789ab.json")
    for name in (*names, *temporary, ".shard-00002-mine.parquet"):
        (tmp_path / name).touch()
    assert set(shard_files(tmp_path)) == {2, 123456}
    assert {path.name for path in leftover_files(tmp_path)} == set(temporary)
    found = read_shard(tmp_path, LAYOUT, PLACE)
    assert np.array_equal(found["index"], np.arange(14, 21))


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(ShardError, match=r"shard-00002\.parquet: missing"):
        read_shard(tmp_path, LAYOUT, PLACE)
    (tmp_path / PLACE.name).mkdir()
    with pytest.raises(ShardError, match=r"shard-00002\.parquet: cannot be read"):
        read_shard(tmp_path, LAYOUT, PLACE)


def test_a_file_that_is_far_too_large_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / PLACE.name).open("wb") as file:
        file.truncate(1 << 34)
    with pytest.raises(ShardError, match="larger than"):
        read_shard(tmp_path, LAYOUT, PLACE)
