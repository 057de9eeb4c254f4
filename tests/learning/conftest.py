"""One classifier for all tests, trained with the grid cut short."""

import pytest

from dynresp.datasets.dataset_reader import Dataset
from dynresp.learning.training import TrainConfig, Trained, train

from .samples import dataset, quiet

QUICK = TrainConfig(
    slices_s=(0.0, 0.1), components=(10,), penalties=(10.0, 100.0), gamma_factors=(1.0,),
    reduced_components=3,
)  # fmt: skip


@pytest.fixture(scope="session")
def hits() -> Dataset:
    return dataset()


@pytest.fixture(scope="session")
def trained(hits: Dataset) -> Trained:
    return train(hits, QUICK, quiet)
