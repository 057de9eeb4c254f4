"""The shipped plans, on built-in motions and on real motion capture."""

from pathlib import Path

import pytest

from dynresp.datasets.dataset_spec_reader import read_dataset_spec
from dynresp.datasets.manifest_reader import parse_facts
from dynresp.datasets.sample_worker import SampleWorker
from dynresp.datasets.shards import decode, shard_ranges
from dynresp.support.paths import example_specs

PLANS = example_specs("datasets")
CORE = sorted(file.stem for file in PLANS.glob("*.toml") if not file.stem.startswith("full"))


def hits(name: str, motions: Path) -> tuple[int, bool]:
    """How many of eight samples are hits, and whether the library is built in."""
    sample_worker = SampleWorker(read_dataset_spec(PLANS / f"{name}.toml"), PLANS, motions)
    manifest = sample_worker.manifest(8)
    facts = parse_facts(manifest)
    place = shard_ranges(facts.identity, 8, 8)[0]
    found = decode(sample_worker.make(place), facts.layout, place, name)
    facts.check(found, name)
    hit = found["outcome"] == facts.outcomes.index("hit")
    return int(hit.sum()), manifest["library"]["built_in"]


@pytest.mark.slow
@pytest.mark.parametrize("name", CORE)
def test_they_run_without_motion_capture(name: str, tmp_path: Path) -> None:
    found, built_in = hits(name, tmp_path)
    assert built_in
    assert found >= 6


@pytest.mark.slow
@pytest.mark.mocap
@pytest.mark.parametrize("name", [*(n for n in CORE if n != "builtin_walk"), "full_walk_balls"])
def test_they_run_on_motion_capture(name: str, motions_folder: Path) -> None:
    found, built_in = hits(name, motions_folder)
    assert not built_in
    assert found >= 6
