"""Mixtures: equal to the slow twin, as likely as many random starts, the same on any machine."""

import numpy as np
import pytest
from sklearn.mixture import GaussianMixture
from threadpoolctl import threadpool_limits

from dynresp.locomotion.clusters.gaussian_mixture import (
    MIN_DEVIATION,
    Mixture,
    fit_from_means,
    fit_mixture,
)
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import MotionError, UsageError
from tests.oracles import mixture as slow


def blobs(
    rng: np.random.Generator, clusters: int, each: int = 40, spread: float = 0.05
) -> tuple[FloatArray, FloatArray]:
    """Observations around distant means, and the means."""
    corners = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], [0, 1])).reshape(4, -1).T
    means = rng.permutation(corners)[:clusters].astype(float)
    x = np.repeat(means, each, axis=0)
    return x + rng.normal(0.0, spread, x.shape), means


def some_mixture(rng: np.random.Generator) -> tuple[Mixture, FloatArray]:
    x, means = blobs(rng, 3, each=15, spread=0.4)
    weights = rng.dirichlet(np.ones(3))
    return Mixture(weights, means, rng.uniform(0.1, 0.5, 3)), x


def test_densities_and_posteriors_are_the_slow_ones(rng: np.random.Generator) -> None:
    mixture, x = some_mixture(rng)
    np.testing.assert_allclose(
        np.exp(mixture.log_densities(x)), [slow.densities(mixture, row) for row in x], rtol=1e-9
    )
    posteriors = np.exp(mixture.log_posteriors(x))
    np.testing.assert_allclose(posteriors, slow.posteriors(mixture, x), rtol=1e-9)
    np.testing.assert_allclose(posteriors.sum(axis=1), 1.0)
    np.testing.assert_array_equal(mixture.labels(x), posteriors.argmax(axis=1))
    assert mixture.log_likelihood(x) == pytest.approx(slow.log_likelihood(mixture, x))


def test_far_observations_have_finite_posteriors(rng: np.random.Generator) -> None:
    mixture, x = some_mixture(rng)
    assert np.isfinite(mixture.log_posteriors(1e4 * x)).all()


def test_bic_counts_what_is_estimated(rng: np.random.Generator) -> None:
    mixture, x = some_mixture(rng)
    # Three means of four numbers, three variances, two free weights.
    assert mixture.parameters == 17
    theirs = GaussianMixture(3, covariance_type="spherical").fit(x)
    ours = Mixture(theirs.weights_, theirs.means_, theirs.covariances_)
    assert ours.bic(x) == pytest.approx(-theirs.bic(x))


def test_em_ends_where_another_step_gains_nothing(rng: np.random.Generator) -> None:
    x, _ = blobs(rng, 3, each=20, spread=0.4)
    fitted = fit_from_means(x, x[[0, 25, 50]])
    more = slow.em_step(fitted, x, MIN_DEVIATION)
    gain = slow.log_likelihood(more, x) - slow.log_likelihood(fitted, x)
    assert abs(gain) < 1e-3 * len(x)


@pytest.mark.parametrize("clusters", [1, 2, 5, 9])
def test_the_clusters_that_were_made_are_found(clusters: int, rng: np.random.Generator) -> None:
    x, means = blobs(rng, clusters)
    fit = fit_mixture(rng.permutation(x))
    assert len(fit.mixture) == clusters
    assert not fit.bounded
    apart = np.linalg.norm(fit.mixture.means[:, None] - means, axis=2)
    assert apart.min(axis=0).max() < 0.05
    np.testing.assert_allclose(fit.mixture.variances, 0.05**2, rtol=0.5)


def test_the_best_point_of_the_curve_is_chosen(rng: np.random.Generator) -> None:
    x, _ = blobs(rng, 4)
    fit = fit_mixture(x)
    assert [point.clusters for point in fit.curve] == list(range(1, len(fit.curve) + 1))
    best = max(fit.curve, key=lambda point: point.bic)
    assert best.clusters == len(fit.mixture)
    assert best.bic == pytest.approx(fit.mixture.bic(x))
    assert best.log_likelihood == pytest.approx(fit.mixture.log_likelihood(x))


def test_the_number_of_clusters_is_bounded(rng: np.random.Generator) -> None:
    x, _ = blobs(rng, 9)
    fit = fit_mixture(x, 4)
    assert len(fit.mixture) == 4
    assert fit.bounded


@pytest.mark.parametrize("seed", [4, 5, 6])
def test_as_likely_as_the_best_of_twenty_random_starts(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = np.concatenate(
        [
            rng.normal(rng.normal(0.0, 1.0, 8), rng.uniform(0.2, 0.7), (rng.integers(15, 60), 8))
            for _ in range(14)
        ]
    )
    fit = fit_mixture(x)
    size = len(fit.mixture)
    starts = [rng.choice(len(x), size, replace=False) for _ in range(20)]
    tried = [fit_from_means(x, x[rows]) for rows in starts]
    assert fit.mixture.log_likelihood(x) >= max(m.log_likelihood(x) for m in tried)
    assert fit.mixture.bic(x) >= max(m.bic(x) for m in tried)


def test_the_same_bits_at_any_thread_count(rng: np.random.Generator) -> None:
    x = rng.normal(size=(700, 36)) * rng.uniform(0.1, 1.0, 36)
    with threadpool_limits(limits=1):
        one = fit_mixture(x, 6)
    two = fit_mixture(x, 6)
    np.testing.assert_array_equal(one.mixture.means, two.mixture.means)
    np.testing.assert_array_equal(one.mixture.variances, two.mixture.variances)


def test_given_seeds_are_where_clusters_begin(rng: np.random.Generator) -> None:
    x, means = blobs(rng, 4)
    fit = fit_mixture(x, seeds=[0, 40, 80, 120])
    np.testing.assert_allclose(fit.mixture.means, means, atol=0.05)
    assert [point.clusters for point in fit.curve] == [4]


@pytest.mark.parametrize("seeds", [[], [1, 1], [-1], [160]])
def test_seeds_that_are_no_rows_are_refused(seeds: list[int], rng: np.random.Generator) -> None:
    with pytest.raises(UsageError, match="different rows 0 to 159"):
        fit_mixture(blobs(rng, 4)[0], seeds=seeds)


def test_equal_observations_are_one_cluster() -> None:
    fit = fit_mixture(np.ones((50, 3)))
    assert len(fit.mixture) == 1
    np.testing.assert_allclose(fit.mixture.variances, MIN_DEVIATION**2)


@pytest.mark.parametrize(
    "x", [np.ones(3), np.ones((1, 3)), np.full((4, 2), np.nan)], ids=["flat", "one", "nan"]
)
def test_observations_of_a_wrong_shape_are_refused(x: FloatArray) -> None:
    with pytest.raises(MotionError, match="finite"):
        fit_mixture(x)


def test_less_than_one_cluster_is_refused(rng: np.random.Generator) -> None:
    with pytest.raises(UsageError, match="max_clusters must be 1 or more, got 0"):
        fit_mixture(blobs(rng, 2)[0], 0)


def test_arrays_are_read_only(rng: np.random.Generator) -> None:
    mixture = fit_mixture(blobs(rng, 2)[0]).mixture
    with pytest.raises(ValueError, match="read-only"):
        mixture.means[0] = 0.0
