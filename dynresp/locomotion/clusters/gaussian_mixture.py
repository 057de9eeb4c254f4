"""Fit a mixture of isotropic Gaussians by EM, and choose its size by BIC.

Source: Lee et al. 2002, section 4.2.1, after Fraley & Raftery 1998. The paper picked the seeds by
hand. Here the mixture grows: it starts with one cluster; then the cluster whose split gains most
likelihood is split, EM runs, and so on. One sweep gives BIC for every number of clusters. In the
best mixture, two clusters are merged and a third one is split (after Ueda et al. 2000, "SMEM
algorithm for mixture models") for as long as that raises the likelihood. Nothing is random and
everything runs on one thread: the same observations give the same bits.

BIC (eq. 6) is 2 L - m log N; larger is better. The paper takes clusters x dimension for m. Here m
counts every estimated number: K means of d numbers, K variances, and K - 1 free weights.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.errors import MotionError, UsageError
from dynresp.support.extras import require

MAX_CLUSTERS = 32
"""Default limit on the number of clusters: a user can still tell so many from each other."""
MIN_DEVIATION = 0.01
"""Its square is added to every variance, in the unit of the observations, so that no cluster
shrinks onto a single observation or onto equal ones."""
# Fewest observations in each half of a split.
_MIN_OBSERVATIONS = 4
# EM tries so many of the most promising splits, and of merges.
_TRIED_SPLITS = 2
# Growing stops when BIC has not risen for so many sizes.
_PATIENCE = 5
# EM stops at this gain in log-likelihood for one observation, or after so many steps. Growing may
# stop early; the mixture that is kept runs to the end.
_GROWING = (1e-3, 30)
_FINAL = (1e-4, 300)


@dataclass(frozen=True, eq=False)
class Mixture:
    """K isotropic Gaussians in d dimensions. The arrays are read-only.

    Attributes:
        weights: (K,) prior probabilities.
        means: (K, d).
        variances: (K,) of each coordinate of a cluster.
    """

    weights: FloatArray
    means: FloatArray
    variances: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for array in (self.weights, self.means, self.variances):
            array.flags.writeable = False

    def __len__(self) -> int:
        """Number of clusters."""
        return len(self.weights)

    @property
    def parameters(self) -> int:
        """How many numbers were estimated."""
        clusters, dimension = self.means.shape
        return clusters * (dimension + 2) - 1

    def log_densities(self, observations: FloatArray) -> FloatArray:
        """Logarithms of weight x density of observations (n, d) in each cluster, (n, K)."""
        dimension = self.means.shape[1]
        out = np.empty((len(observations), len(self)))
        for k, (mean, variance) in enumerate(zip(self.means, self.variances, strict=True)):
            offset = observations - mean
            out[:, k] = np.einsum("nd,nd->n", offset, offset) / variance
        constant = np.log(self.weights) - 0.5 * dimension * np.log(2.0 * np.pi * self.variances)
        return constant - 0.5 * out

    def log_posteriors(self, observations: FloatArray) -> FloatArray:
        """Logarithms of P(cluster | observation), (n, K): rows add up to 1 before the logarithm."""
        logs = self.log_densities(observations)
        return logs - _log_sum(logs)[:, None]

    def labels(self, observations: FloatArray) -> IntArray:
        """(n,) the most probable cluster of each observation."""
        return np.argmax(self.log_densities(observations), axis=1).astype(np.int32)

    def log_likelihood(self, observations: FloatArray) -> float:
        """L of eq. 6: the sum of the logarithms of the mixture's density at all observations."""
        return float(_log_sum(self.log_densities(observations)).sum())

    def bic(self, observations: FloatArray) -> float:
        """Eq. 6: larger is better."""
        n = len(observations)
        return 2.0 * self.log_likelihood(observations) - self.parameters * float(np.log(n))


@dataclass(frozen=True)
class CurvePoint:
    """How well a mixture of one size fits, while growing.

    Attributes:
        clusters: How many.
        log_likelihood: Of all observations.
        bic: Eq. 6.
    """

    clusters: int
    log_likelihood: float
    bic: float


@dataclass(frozen=True, eq=False)
class MixtureFit:
    """A fitted mixture and how its size was chosen.

    Attributes:
        mixture: The one of the best BIC, refined.
        curve: All sizes that were tried, ascending; one point where seeds were given.
        bounded: Whether the largest allowed number of clusters had the best BIC.
    """

    mixture: Mixture
    curve: tuple[CurvePoint, ...]
    bounded: bool


def fit_mixture(
    observations: npt.ArrayLike,
    max_clusters: int = MAX_CLUSTERS,
    seeds: Sequence[int] | None = None,
) -> MixtureFit:
    """Fit a mixture to observations.

    Args:
        observations: (n, d), finite, all coordinates in comparable units.
        max_clusters: Most clusters, at least 1; seeds override it.
        seeds: Rows of the observations that are the first means, one for each cluster, as the
            paper's authors picked them. Without seeds the mixture grows.

    Raises:
        MotionError: The observations are not a finite (n, d) array of at least two rows.
        UsageError: max_clusters is below 1, or the seeds are not different rows.
    """
    from threadpoolctl import threadpool_limits

    if max_clusters < 1:
        raise UsageError(f"max_clusters must be 1 or more, got {max_clusters}")
    x = np.ascontiguousarray(observations, dtype=np.float64)
    if x.ndim != 2 or len(x) < 2 or x.size == 0 or not np.isfinite(x).all():
        raise MotionError(
            f"observations must be a finite (n, d) array of at least two, got shape {x.shape}"
        )
    # The last bits of sums in BLAS depend on the number of threads.
    with threadpool_limits(limits=1):
        if seeds is not None:
            mixture = fit_from_means(x, x[_checked_seeds(seeds, len(x))])
            return MixtureFit(mixture, (_point(mixture, x),), False)
        grown = list(_grow(x, max_clusters))
        points = [_point(mixture, x) for mixture in grown]
        best = int(np.argmax([p.bic for p in points]))
        mixture = _refined(x, grown[best])
        points[best] = _point(mixture, x)
    return MixtureFit(mixture, tuple(points), best + 1 == max_clusters > 1)


def fit_from_means(x: FloatArray, means: FloatArray) -> Mixture:
    """Run EM from given means, equal weights, and the variance around the nearest mean.

    Args:
        x: (n, d) observations.
        means: (K, d).
    """
    nearest = np.full(len(x), np.inf)
    for mean in means:
        nearest = np.minimum(nearest, np.sum((x - mean) ** 2, axis=1))
    variance = float(nearest.mean()) / x.shape[1] + MIN_DEVIATION**2
    size = len(means)
    start = Mixture(np.full(size, 1.0 / size), np.array(means), np.full(size, variance))
    return _em(x, start, _FINAL)


def _em(x: FloatArray, start: Mixture, stop: tuple[float, int]) -> Mixture:
    require("sklearn")
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.mixture import GaussianMixture

    model = GaussianMixture(
        len(start),
        covariance_type="spherical",
        tol=stop[0],
        max_iter=stop[1],
        reg_covar=MIN_DEVIATION**2,
        weights_init=start.weights,
        means_init=start.means,
        precisions_init=1.0 / start.variances,
        # The start is given in full; other values would spend time on one of their own.
        init_params="random_from_data",
        random_state=0,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        model.fit(x)
    return Mixture(model.weights_, model.means_, model.covariances_)


@dataclass(frozen=True, eq=False)
class _Group:
    """Observations of one Gaussian: how many, their mean and variance."""

    count: int
    mean: FloatArray
    variance: float

    @classmethod
    def of(cls, x: FloatArray) -> _Group:
        mean = x.mean(axis=0)
        return cls(len(x), mean, float(np.mean((x - mean) ** 2)) + MIN_DEVIATION**2)

    @property
    def score(self) -> float:
        """Log-likelihood without the terms that a split or merge does not change."""
        entropy = 0.5 * len(self.mean) * np.log(self.variance)
        return self.count * (float(np.log(self.count)) - float(entropy))


def _grow(x: FloatArray, max_clusters: int) -> Iterator[Mixture]:
    """Mixtures of 1, 2, ... clusters; each splits one cluster of the mixture before it."""
    whole = _Group.of(x)
    mixture = Mixture(np.ones(1), whole.mean[None], np.array([whole.variance]))
    best, since = -np.inf, 0
    while True:
        yield mixture
        bic = mixture.bic(x)
        best, since = (bic, 0) if bic > best else (best, since + 1)
        if len(mixture) >= max_clusters or since >= _PATIENCE:
            return
        groups = _groups(x, mixture)
        halves = _ranked_splits(groups)[:_TRIED_SPLITS]
        tried = [_em(x, _replaced(mixture, (k,), (a, b)), _GROWING) for k, (a, b) in halves]
        if not tried:
            return
        mixture = max(tried, key=lambda m: m.log_likelihood(x))


def _refined(x: FloatArray, mixture: Mixture) -> Mixture:
    """Merge two clusters and split a third, while that raises the likelihood."""
    mixture = _em(x, mixture, _FINAL)
    likelihood = mixture.log_likelihood(x)
    # Each round must gain more than the tolerance of EM; the number of rounds is limited.
    for _ in range(len(mixture)):
        moves = list(_moves(x, mixture))
        for start in moves:
            moved = _em(x, start, _FINAL)
            gain = moved.log_likelihood(x) - likelihood
            if gain > _FINAL[0] * len(x):
                mixture, likelihood = moved, likelihood + gain
                break
        else:
            break
    return mixture


def _moves(x: FloatArray, mixture: Mixture) -> Iterator[Mixture]:
    """Starts for EM: two clusters merged and another one split, the most promising first."""
    members = _groups(x, mixture)
    groups = [_Group.of(g) if len(g) else None for g in members]
    merges: list[tuple[float, int, int, _Group]] = []
    for i, a in enumerate(groups):
        for j, b in enumerate(groups[:i]):
            if a is not None and b is not None:
                merged = _merged(a, b)
                merges.append((merged.score - a.score - b.score, i, j, merged))
    merges.sort(key=lambda m: -m[0])
    splits = _ranked_splits(members)
    for _, i, j, merged in merges[:_TRIED_SPLITS]:
        others = [(k, halves) for k, halves in splits if k not in (i, j)]
        for k, (a, b) in others[:_TRIED_SPLITS]:
            yield _replaced(mixture, (i, j, k), (merged, a, b))


def _groups(x: FloatArray, mixture: Mixture) -> list[FloatArray]:
    labels = mixture.labels(x)
    return [x[labels == k] for k in range(len(mixture))]


def _ranked_splits(
    groups: Sequence[FloatArray],
) -> list[tuple[int, tuple[_Group, _Group]]]:
    """Clusters that can be split, with their halves, by falling gain in likelihood."""
    found: list[tuple[float, int, tuple[_Group, _Group]]] = []
    for k, group in enumerate(groups):
        side = _halves(group) if len(group) >= 2 * _MIN_OBSERVATIONS else None
        if side is None or min(side.sum(), (~side).sum()) < _MIN_OBSERVATIONS:
            continue
        a, b = _Group.of(group[side]), _Group.of(group[~side])
        found.append((a.score + b.score - _Group.of(group).score, k, (a, b)))
    found.sort(key=lambda split: -split[0])
    return [(k, halves) for _, k, halves in found]


def _halves(x: FloatArray) -> npt.NDArray[np.bool_] | None:
    """(n,) which half each belongs to: 2-means, started along the longest axis of the cloud."""
    centered = x - x.mean(axis=0)
    # Eigenvectors of a d x d matrix are cheaper than singular vectors of all observations.
    side = centered @ np.linalg.eigh(centered.T @ centered)[1][:, -1] > 0.0
    for _ in range(10):
        if side.all() or not side.any():
            return None
        a, b = x[side].mean(axis=0), x[~side].mean(axis=0)
        nearer = np.sum((x - a) ** 2, axis=1) < np.sum((x - b) ** 2, axis=1)
        if np.array_equal(nearer, side):
            break
        side = nearer
    return None if side.all() or not side.any() else side


def _merged(a: _Group, b: _Group) -> _Group:
    count = a.count + b.count
    share = a.count / count
    between = share * (1.0 - share) * float(np.mean((a.mean - b.mean) ** 2))
    variance = share * a.variance + (1.0 - share) * b.variance + between
    return _Group(count, share * a.mean + (1.0 - share) * b.mean, variance)


def _replaced(mixture: Mixture, removed: tuple[int, ...], groups: tuple[_Group, ...]) -> Mixture:
    """The mixture after groups of observations replace some clusters and take over their weight."""
    counts = np.array([group.count for group in groups], dtype=np.float64)
    weights = np.append(
        np.delete(mixture.weights, removed),
        mixture.weights[list(removed)].sum() * counts / counts.sum(),
    )
    means = np.vstack([np.delete(mixture.means, removed, axis=0), *(g.mean[None] for g in groups)])
    variances = np.append(np.delete(mixture.variances, removed), [g.variance for g in groups])
    return Mixture(weights / weights.sum(), means, variances)


def _checked_seeds(seeds: Sequence[int], count: int) -> list[int]:
    rows = [int(s) for s in seeds]
    if not rows or len(set(rows)) < len(rows) or min(rows) < 0 or max(rows) >= count:
        raise UsageError(
            f"seeds must be different rows 0 to {count - 1} of the observations, got {rows}"
        )
    return rows


def _point(mixture: Mixture, x: FloatArray) -> CurvePoint:
    return CurvePoint(len(mixture), mixture.log_likelihood(x), mixture.bic(x))


def _log_sum(logs: FloatArray) -> FloatArray:
    highest = logs.max(axis=1)
    total: FloatArray = highest + np.log(np.exp(logs - highest[:, None]).sum(axis=1))
    return total
