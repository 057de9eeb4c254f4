"""A small dataset, made once, and the worker that made it."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from dynresp.datasets import generation as making
from dynresp.datasets.sample_worker import Job, SampleWorker
from dynresp.datasets.shards import ShardRange

from .samples import plan


@pytest.fixture(scope="session")
def sample_worker(tmp_path_factory: pytest.TempPathFactory) -> SampleWorker:
    """The worker of the spec; motions are looked for in an empty folder."""
    empty = tmp_path_factory.mktemp("motions")
    return SampleWorker(plan(), empty, empty)


@pytest.fixture
def made_in_this_process(sample_worker: SampleWorker, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Has one worker, which is this process; lists the shards that it makes.

    Only for the spec of these tests, whatever its count.
    """
    made: list[int] = []

    def make(
        job: Job, wanted: Sequence[ShardRange], *rest: Any
    ) -> Iterator[tuple[ShardRange, bytes]]:
        for place in wanted:
            made.append(place.number)
            yield place, sample_worker.make(place)

    class SameWorkshop:
        def __new__(cls, plan: Any, *rest: Any) -> Any:
            return sample_worker if plan == sample_worker.spec else SampleWorker(plan, *rest)

    monkeypatch.setattr(making, "make_locally", make)
    monkeypatch.setattr(making, "SampleWorker", SameWorkshop)
    return made


@pytest.fixture(scope="session")
def dataset(sample_worker: SampleWorker, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The spec's dataset: 20 samples in shards of 8, made by this process. Not to be changed."""
    from dynresp.datasets.manifest import write_manifest
    from dynresp.datasets.shards import shard_ranges

    folder = tmp_path_factory.mktemp("dataset")
    manifest = sample_worker.manifest(8)
    for place in shard_ranges(manifest["identity"], 20, 8):
        (folder / place.name).write_bytes(sample_worker.make(place))
    write_manifest(manifest, folder)
    return folder
