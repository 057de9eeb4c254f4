import shutil
from pathlib import Path

import numpy as np
import pytest

from dynresp.datasets.dataset_reader import load_dataset
from dynresp.datasets.sample_draws import draw_sample
from dynresp.datasets.shards import encode, read_shard, shard_ranges
from dynresp.support.errors import DynrespError, UsageError

from .samples import plan


@pytest.fixture
def copied(dataset: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(dataset, tmp_path / "copy"))


def test_all_samples_are_there(dataset: Path) -> None:
    data = load_dataset(dataset)
    facts = data.facts
    assert len(data) == facts.count == 20
    assert np.array_equal(data.index, np.arange(20))
    assert data.features.shape == (20, len(facts.feature_names))
    assert data.errors.shape == data.exit_frames.shape == (20, len(facts.classes))
    assert data.contact_point.shape == (20, 3)
    hit = data.outcome == facts.outcomes.index("hit")
    assert hit.sum() > 10
    assert np.isfinite(data.features[hit]).all()
    assert np.isfinite(data.errors[hit]).all()
    assert (data.label[hit] >= 0).all()
    assert (data.label[~hit] == -1).all()
    assert not data.features.flags.writeable


def test_what_was_drawn_is_told(dataset: Path) -> None:
    data = load_dataset(dataset)
    for row in range(20):
        sample = draw_sample(plan(), (12.0, 4.0), row)
        kind = sample.values["kind"]
        assert data.facts.kinds[data.kind[row]] == kind
        assert data.facts.bodies[data.target[row]] == sample.values["target"]
        assert (data.base[row], data.impact[row]) == (sample.base, sample.table)
        for name in ("phase", "from_deg", "speed_m_s", "force_n", "height_m"):
            asked = sample.phase if name == "phase" else sample.values.get(name)
            given = data.parameters[name][row]
            assert np.isnan(given) if asked is None else given == asked


def test_the_label_is_the_class_of_least_error_unless_it_carries_on(dataset: Path) -> None:
    data = load_dataset(dataset, hits_only=True)
    last = len(data.facts.classes) - 1
    reacts = data.label != last
    assert reacts.any()
    best = np.argmin(data.errors[reacts, :last], axis=1)
    assert np.array_equal(data.label[reacts], best)


def test_parts_of_it(dataset: Path) -> None:
    data = load_dataset(dataset)
    assert np.array_equal(load_dataset(dataset, limit=10).index, np.arange(10))
    assert len(load_dataset(dataset, limit=1000)) == 20
    some = data.take(np.array([3, 1]))
    assert some.index.tolist() == [3, 1]
    assert np.array_equal(some.parameters["phase"], data.parameters["phase"][[3, 1]])
    hits = load_dataset(dataset, hits_only=True)
    hit = data.outcome == data.facts.outcomes.index("hit")
    assert np.array_equal(hits.index, data.index[hit])
    assert np.array_equal(hits.features, data.features[hit])
    with pytest.raises(UsageError, match="limit: expected at least 1"):
        load_dataset(dataset, limit=0)


@pytest.mark.parametrize("what", ["missing", "cut", "changed", "swapped", "empty"])
def test_damage_is_named(copied: Path, what: str) -> None:
    file = copied / "shard-00001.parquet"
    data = bytearray(file.read_bytes())
    if what == "missing":
        file.unlink()
    elif what == "cut":
        file.write_bytes(data[:-100])
    elif what == "changed":
        data[len(data) // 2] ^= 1
        file.write_bytes(data)
    elif what == "swapped":
        file.write_bytes((copied / "shard-00000.parquet").read_bytes())
    else:
        file.write_bytes(b"")
    with pytest.raises(DynrespError) as caught:
        load_dataset(copied)
    message = str(caught.value)
    assert message.startswith(str(file))
    assert "`dynresp generate`" in message
    # What lies before can be read.
    assert len(load_dataset(copied, limit=8)) == 8


def test_indices_that_lead_nowhere_are_refused(copied: Path) -> None:
    """Also where the shard's hash fits."""
    facts = load_dataset(copied).facts
    place = shard_ranges(facts.identity, facts.count, facts.shard_size)[1]
    for column, number in (("label", 25), ("outcome", -1), ("target", 14), ("base", 2)):
        contents = read_shard(copied, facts.layout, place)
        contents[column] = contents[column].copy()
        contents[column][3] = number
        (copied / place.name).write_bytes(encode(contents, facts.layout, place))
        with pytest.raises(DynrespError, match=rf"00001\.parquet: damaged \({column} has an index"):
            load_dataset(copied)
        contents[column][3] = 0
        (copied / place.name).write_bytes(encode(contents, facts.layout, place))
        load_dataset(copied)
