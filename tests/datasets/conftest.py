"""A small dataset, made once, and the workshop it was made in."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from dynresp.datasets import generation as making
from dynresp.datasets.sample_worker import Job, Workshop
from dynresp.datasets.shards import Place

from .samples import plan


@pytest.fixture(scope="session")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    """The plan's workshop; motions are looked for in an empty folder."""
    empty = tmp_path_factory.mktemp("motions")
    return Workshop(plan(), empty, empty)


@pytest.fixture
def made_in_this_process(workshop: Workshop, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Has one worker, which is this process; lists the shards that it makes.

    Only for the plan of these tests, whatever its count.
    """
    made: list[int] = []

    def make(job: Job, wanted: Sequence[Place], *rest: Any) -> Iterator[tuple[Place, bytes]]:
        for place in wanted:
            made.append(place.number)
            yield place, workshop.make(place)

    class SameWorkshop:
        def __new__(cls, plan: Any, *rest: Any) -> Any:
            return workshop if plan == workshop.plan else Workshop(plan, *rest)

    monkeypatch.setattr(making, "make_here", make)
    monkeypatch.setattr(making, "Workshop", SameWorkshop)
    return made


@pytest.fixture(scope="session")
def dataset(workshop: Workshop, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plan's dataset: 20 samples in shards of 8, made by this process. Not to be changed."""
    from dynresp.datasets.manifest import write_manifest
    from dynresp.datasets.shards import places

    folder = tmp_path_factory.mktemp("dataset")
    manifest = workshop.manifest(8)
    for place in places(manifest["identity"], 20, 8):
        (folder / place.name).write_bytes(workshop.make(place))
    write_manifest(manifest, folder)
    return folder
