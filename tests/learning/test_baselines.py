import numpy as np

from dynresp.learning.baselines import (
    NEIGHBOURS,
    at_random,
    most_frequent,
    nearest_neighbours,
)
from dynresp.learning.labelled_samples import Labelled

from ..oracles import learning as slow


def labelled(rng: np.random.Generator, samples: int) -> Labelled:
    return Labelled(
        index=np.arange(samples),
        features=(rng.normal(size=(samples, 4)) * [1.0, 10.0, 0.1, 1.0]).astype(np.float32),
        labels=rng.integers(3, size=samples),
        errors=np.ones((samples, 4)),
        grazes=np.zeros(samples, bool),
        carry_on_limit=1.5,
    )


def test_neighbours_are_those_of_a_plain_search(rng: np.random.Generator) -> None:
    known, asked = labelled(rng, 80), labelled(rng, 40)
    found = nearest_neighbours(known, asked.features, 4)
    for row, choice in zip(asked.features, found, strict=True):
        assert choice[0] == slow.neighbours(known.features, known.labels, row, NEIGHBOURS)
        assert choice[1] != choice[0]
    # A class that no sample has is never chosen.
    assert found.max() < 3


def test_few_samples_and_features_that_never_change(rng: np.random.Generator) -> None:
    known = labelled(rng, 3)
    known.features[:, 1] = 5.0
    assert nearest_neighbours(known, known.features[:1], 4).shape == (1, 2)


def test_the_most_frequent_classes() -> None:
    assert most_frequent([3, 9, 0, 5], 2).tolist() == [[1, 3], [1, 3]]


def test_chance_takes_two_different_classes(rng: np.random.Generator) -> None:
    found = at_random([2, 5, 7], 600, rng)
    assert (found[:, 0] != found[:, 1]).all()
    assert set(found.ravel()) == {2, 5, 7}
    assert np.bincount(found[:, 0])[[2, 5, 7]].min() > 150
