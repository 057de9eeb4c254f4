"""Isotropic Gaussian mixtures, slow and readable: density by density, sum by sum."""

import math

import numpy as np

from dynresp.locomotion.clusters.gaussian_mixture import Mixture
from dynresp.motion.rotations import FloatArray


def log_density(x: FloatArray, mean: FloatArray, variance: float) -> float:
    """Logarithm of an isotropic Gaussian's density at a point."""
    squares = sum((float(a) - float(m)) ** 2 for a, m in zip(x, mean, strict=True))
    return -0.5 * squares / variance - 0.5 * len(x) * math.log(2.0 * math.pi * variance)


def densities(mixture: Mixture, x: FloatArray) -> list[float]:
    """Weight x density of each cluster at a point."""
    return [
        float(weight) * math.exp(log_density(x, mean, float(variance)))
        for weight, mean, variance in zip(
            mixture.weights, mixture.means, mixture.variances, strict=True
        )
    ]


def posteriors(mixture: Mixture, observations: FloatArray) -> FloatArray:
    """(n, K) P(cluster | observation)."""
    rows = [np.array(densities(mixture, x)) for x in observations]
    return np.array([row / row.sum() for row in rows])


def log_likelihood(mixture: Mixture, observations: FloatArray) -> float:
    """The sum of the logarithms of the mixture's density at all observations."""
    return sum(math.log(sum(densities(mixture, x))) for x in observations)


def em_step(mixture: Mixture, observations: FloatArray, least_deviation: float) -> Mixture:
    """One expectation and one maximisation."""
    shares = posteriors(mixture, observations)
    weights, means, variances = [], [], []
    for share in shares.T:
        total = share.sum()
        mean = sum(s * x for s, x in zip(share, observations, strict=True)) / total
        spread = sum(s * np.mean((x - mean) ** 2) for s, x in zip(share, observations, strict=True))
        weights.append(total / len(observations))
        means.append(mean)
        variances.append(spread / total + least_deviation**2)
    return Mixture(np.array(weights), np.array(means), np.array(variances))
