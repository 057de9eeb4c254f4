"""Compiled loops of prediction: all pairs of classes, or only the pairs that decide.

Importing this module imports numba; so import it where it is used. The kernels compute every row
with the same instructions, so a row has the same result, bit for bit, alone and in any batch.

The score of a class is its votes in all pairs, plus a bounded confidence that orders equal votes.
The best class is found without most of the pairs. First comes a knock-out: each class is compared
with the leader so far, and the winner leads. Then the leader is compared with the classes it has
not met, which gives its score. By then every other class has lost at least once. So if the leader
has not lost, no other class can have as many votes. If it has lost (three classes can beat each
other in a circle), the classes with no more losses are examined in the same way, until none is left
that could match it. The next ranks are found in the same way among the rest, with the pairs that
are already known.
"""

from __future__ import annotations

import numpy as np
from numba import types

from dynresp.support.compiling import compiled, helper

LANES = 64
"""Rows of weights are padded with zeros to a multiple of this, so that loops have no remainder."""

# Larger principal components are not plausible; their products would overflow single precision.
_LARGEST = 1e9
# Rows for which the projection is read once; their features stay in the first-level cache.
_BLOCK = 8

# Sums of products may be spread over vector lanes; NaN must keep its meaning, since it is checked.
_FASTMATH = {"reassoc", "contract", "nsz"}

_ROWS = types.Array(types.float64, 2, "C", readonly=True)
_SINGLE = types.Array(types.float32, 2, "C", readonly=True)
_VECTOR = types.Array(types.float64, 1, "C", readonly=True)


@helper(fastmath=_FASTMATH)
def _project(features, projection, offset, reduced):
    """Principal components of some rows; returns the first row out of range, -1 if there is none.

    NaN or infinity in a feature reaches every component, even by 0 * inf = NaN.
    """
    bad = len(features)
    for c in range(len(projection)):
        for n in range(len(features)):
            value = 0.0
            for i in range(features.shape[1]):
                value += projection[c, i] * features[n, i]
            value += offset[c]
            if not abs(value) < _LARGEST:
                bad = min(bad, n)
            reduced[n, c] = value
    return bad if bad < len(features) else -1


@helper
def _expand(reduced, monomials):
    """Monomials of the principal components of one row, without the padding."""
    components = len(reduced)
    monomials[0] = 1
    at = 1
    for c in range(components):
        monomials[at + c] = reduced[c]
    at += components
    for c in range(components):
        factor = reduced[c]
        for d in range(components - c):
            monomials[at + d] = factor * reduced[c + d]
        at += components - c


@helper
def _pair(first, second, classes):
    """Index of a pair of classes, given in either order, among all pairs."""
    low, high = min(first, second), max(first, second)
    return low * (2 * classes - low - 1) // 2 + high - low - 1


@helper
def _score(c, classes, decisions):
    """Votes and bounded confidence of one class, added in scikit-learn's order."""
    votes, confidence = 0.0, 0.0
    for other in range(classes):
        if other != c:
            decision = np.float64(decisions[_pair(c, other, classes)])
            if (decision < 0.0) == (c > other):
                votes += 1.0
            confidence += decision if c < other else -decision
    return votes + confidence / (3.0 * (abs(confidence) + 1.0))


@helper(fastmath=_FASTMATH)
def _next_best(classes, weights, monomials, decisions, known, losses, scored, ranked, scores):
    """The class of highest score that has no rank yet; evaluates the pairs that this needs."""
    best = -1
    for c in range(classes):
        if scored[c] and not ranked[c] and (best < 0 or scores[c] > scores[best]):
            best = c
    while True:
        leader = -1
        for c in range(classes):
            if not ranked[c] and not scored[c] and (leader < 0 or losses[c] < losses[leader]):
                leader = c
        # Votes count before confidences: a class with more losses cannot come first.
        if leader < 0 or (best >= 0 and losses[leader] > losses[best]):
            return best
        # First the knock-out, then the leader against all. This is one loop without helpers that
        # take arrays, because counting references to these took most of the time.
        for step in range(2 * classes):
            knock_out = step < classes
            c = step if knock_out else step - classes
            if c == leader:
                continue
            if knock_out:
                if ranked[c] or scored[c] or losses[c] > losses[leader]:
                    continue
            elif best >= 0 and losses[leader] > losses[best]:
                break
            pair = _pair(leader, c, classes)
            if known[pair]:
                continue
            total = weights.dtype.type(0)
            for i in range(len(monomials)):
                total += weights[pair, i] * monomials[i]
            decisions[pair] = total
            known[pair] = True
            if (total < 0) == (leader > c):
                losses[c] += 1
            else:
                losses[leader] += 1
                if knock_out:
                    leader = c
        if best >= 0 and losses[leader] > losses[best]:
            continue
        scored[leader] = True
        scores[leader] = _score(leader, classes, decisions)
        if (
            best < 0
            or scores[leader] > scores[best]
            or (scores[leader] == scores[best] and leader < best)
        ):
            best = leader


@helper(fastmath=_FASTMATH)
def _all_pairs(weights, monomials, decisions):
    """Decisions of all pairs for some rows; each row of weights is read once."""
    for pair in range(len(weights)):
        for n in range(len(decisions)):
            total = weights.dtype.type(0)
            for i in range(monomials.shape[1]):
                total += weights[pair, i] * monomials[n, i]
            decisions[n, pair] = total


def _rank(features, projection, offset, weights, classes, ranks):
    """Find the best classes of every row, evaluating only pairs that can matter.

    Args:
        features: (n, F) float64.
        projection: (k, F) float64.
        offset: (k,) float64.
        weights: (pairs, monomials padded to a multiple of `LANES`) float64 or float32.
        classes: Number of classes.
        ranks: Out, (n, best) indices of classes, the highest score first, of equal scores the
            lowest index first.

    Returns:
        Index of the first row that is not finite or out of range, -1 if there is none.
    """
    reduced = np.empty((_BLOCK, len(projection)), weights.dtype)
    monomials = np.zeros(weights.shape[1], weights.dtype)
    decisions = np.empty(len(weights), weights.dtype)
    known = np.empty(len(weights), np.bool_)
    losses = np.empty(classes, np.int64)
    scored = np.empty(classes, np.bool_)
    ranked = np.empty(classes, np.bool_)
    scores = np.empty(classes)
    for start in range(0, len(features), _BLOCK):
        stop = min(start + _BLOCK, len(features))
        bad = _project(features[start:stop], projection, offset, reduced)
        if bad >= 0:
            return start + bad
        for n in range(start, stop):
            _expand(reduced[n - start], monomials)
            known[:] = False
            losses[:] = 0
            scored[:] = False
            ranked[:] = False
            for position in range(ranks.shape[1]):
                best = _next_best(
                    classes, weights, monomials, decisions, known, losses, scored, ranked, scores
                )
                ranked[best] = True
                ranks[n, position] = best
    return -1


def _decide(features, projection, offset, weights, decisions):
    """Evaluate all pairs of every row.

    Args:
        features: As in `_rank`.
        projection: As in `_rank`.
        offset: As in `_rank`.
        weights: As in `_rank`.
        decisions: Out, (n, pairs) in the precision of `weights`.

    Returns:
        Index of the first row that is not finite or out of range, -1 if there is none.
    """
    reduced = np.empty((_BLOCK, len(projection)), weights.dtype)
    monomials = np.zeros((_BLOCK, weights.shape[1]), weights.dtype)
    for start in range(0, len(features), _BLOCK):
        stop = min(start + _BLOCK, len(features))
        bad = _project(features[start:stop], projection, offset, reduced)
        if bad >= 0:
            return start + bad
        for n in range(stop - start):
            _expand(reduced[n], monomials[n])
        _all_pairs(weights, monomials, decisions[start:stop])
    return -1


def _score_all(classes, decisions, scores):
    """Scores of all classes of every row, as in scikit-learn's `decision_function`.

    Args:
        classes: Number of classes.
        decisions: (n, pairs) float64 or float32.
        scores: Out, (n, classes).
    """
    for n in range(len(decisions)):
        for c in range(classes):
            scores[n, c] = _score(c, classes, decisions[n])


_PRECISIONS = (
    (np.dtype(np.float64), _ROWS, types.float64),
    (np.dtype(np.float32), _SINGLE, types.float32),
)
# One kernel for each precision of the weights, so that a program compiles the one that it uses.
rank_kernels = {
    dtype: compiled(types.int64(_ROWS, _ROWS, _VECTOR, weights, types.int64, types.int64[:, ::1]))(
        _rank
    )
    for dtype, weights, _ in _PRECISIONS
}
"""See `_rank`, by the precision of `weights`."""
decision_kernels = {
    dtype: compiled(types.int64(_ROWS, _ROWS, _VECTOR, weights, types.Array(scalar, 2, "C")))(
        _decide
    )
    for dtype, weights, scalar in _PRECISIONS
}
"""See `_decide`, by the precision of `weights`."""
score_kernels = {
    dtype: compiled(types.void(types.int64, types.Array(scalar, 2, "C"), types.float64[:, ::1]))(
        _score_all
    )
    for dtype, _, scalar in _PRECISIONS
}
"""See `_score_all`, by the precision of `decisions`."""
