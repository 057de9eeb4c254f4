"""`PairwiseQuadratic`: a trained pipeline, compiled so that predictions are fast.

The cost of a prediction does not depend on the number of training samples.

The pipeline is `StandardScaler`, `PCA`, `SVC` with a polynomial kernel of degree two. The first two
steps are one affine map to k principal components z. The kernel between z and a support vector s,
(gamma s.z + coef0)^2, is linear in the monomials of z up to degree two, of which there are
1 + k + k (k + 1) / 2. So the sum over all support vectors that decides between two classes is one
row of weights over the monomials, summed once when the predictor is made.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import UsageError
from dynresp.support.extras import require

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline

_EXPECTED = (
    "expected a fitted Pipeline of StandardScaler(), PCA(k) and SVC(kernel='poly', degree=2, "
    "break_ties=True, decision_function_shape='ovr')"
)
# Support vectors expanded at a time, which bounds the memory of `from_pipeline`.
_CHUNK = 1024

Weights = npt.NDArray[np.float64] | npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class PairwiseQuadratic:
    """One quadratic function of the principal components for every pair of classes.

    The pairs are (0, 1), (0, 2), ..., (0, c - 1), (1, 2), ...; the monomials of z are 1, then
    z_0 ... z_(k-1), then z_i z_j for i <= j in the same order as the pairs with i = j included.
    The arrays are made read-only.

    Attributes:
        projection: (k, F), standardisation and principal components in one: z = projection @
            features + offset.
        offset: (k,).
        weights: (pairs, monomials), float64 or float32; the precision of the products.
        classes: Number of classes, at least two.
    """

    projection: FloatArray
    offset: FloatArray
    weights: Weights
    classes: int
    _padded: Weights = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the arrays and pad the weights for the compiled loops.

        Raises:
            UsageError: Shapes do not fit together, or a value is not finite.
        """
        from dynresp.response.prediction.compiled_classifier_kernel import LANES

        components = len(self.projection)
        expected = (self.classes * (self.classes - 1) // 2, _monomial_count(components))
        if (
            self.classes < 2
            or self.projection.ndim != 2
            or self.offset.shape != (components,)
            or self.weights.shape != expected
        ):
            raise UsageError(
                f"projection {self.projection.shape}, offset {self.offset.shape} and weights "
                f"{self.weights.shape} of {self.classes} classes do not fit together; expected "
                f"(k, features), (k,) and {expected}, and at least two classes."
            )
        single = self.weights.dtype == np.float32
        padded = np.zeros(
            (expected[0], -(-expected[1] // LANES) * LANES), np.float32 if single else np.float64
        )
        padded[:, : expected[1]] = self.weights
        arrays = {
            "projection": np.array(self.projection, dtype=np.float64, order="C"),
            "offset": np.array(self.offset, dtype=np.float64),
            "_padded": padded,
        }
        for name, array in arrays.items():
            if not np.all(np.isfinite(array)):
                raise UsageError(
                    f"{name.replace('_padded', 'weights')} of a predictor hold NaN or infinity; "
                    f"train it again."
                )
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "weights", padded[:, : expected[1]])

    @classmethod
    def from_pipeline(cls, pipeline: Pipeline) -> PairwiseQuadratic:
        """Compile a trained pipeline.

        Args:
            pipeline: Fitted `StandardScaler`, `PCA`, `SVC(kernel="poly", degree=2,
                break_ties=True, decision_function_shape="ovr")`, with any `gamma`, `coef0` and C.

        Returns:
            The predictor in double precision. Class i is `pipeline.classes_[i]`.

        Raises:
            UsageError: The pipeline has other steps or settings, or is not fitted.
        """
        scaler, pca, svc = _checked_steps(pipeline)
        projection = pca.components_ / scaler.scale_
        offset = -(pca.components_ @ (scaler.mean_ / scaler.scale_ + pca.mean_))
        classes = len(svc.classes_)
        return cls(projection, offset, _pair_weights(svc), classes)

    def single_precision(self) -> PairwiseQuadratic:
        """The same with weights and products in float32: half the memory, twice the speed."""
        return replace(self, weights=self.weights.astype(np.float32))

    def pair_decisions(self, features: npt.ArrayLike) -> Weights:
        """Evaluate all pairs.

        Args:
            features: (n, F) or (F,).

        Returns:
            (n, pairs) in the precision of `weights`, with libsvm's sign: a pair (i, j) with i < j
            is a vote for j if its value is below zero, else for i. This is what scikit-learn's
            `SVC` computes for `decision_function_shape="ovo"`, except that for two classes its
            `decision_function` has the other sign.

        Raises:
            UsageError: Features of another shape, or not finite.
        """
        from dynresp.response.prediction import (
            compiled_classifier_kernel as prediction_kernel,
        )

        rows = self._rows(features)
        decisions = np.empty((len(rows), len(self.weights)), dtype=self.weights.dtype)
        bad = prediction_kernel.decision_kernels[self._padded.dtype](
            rows, self.projection, self.offset, self._padded, decisions
        )
        self._refuse(bad)
        return decisions

    def scores(self, features: npt.ArrayLike) -> FloatArray:
        """Score all classes: votes plus a bounded sum of the pairs' decisions.

        Args:
            features: (n, F) or (F,).

        Returns:
            (n, classes). With more than two classes this is scikit-learn's
            `SVC.decision_function`. With two classes scikit-learn has one number a row; here votes
            and decisions are counted as with more.

        Raises:
            UsageError: Features of another shape, or not finite.
        """
        from dynresp.response.prediction import (
            compiled_classifier_kernel as prediction_kernel,
        )

        decisions = self.pair_decisions(features)
        scores = np.empty((len(decisions), self.classes))
        prediction_kernel.score_kernels[decisions.dtype](self.classes, decisions, scores)
        return scores

    def rank(self, features: npt.ArrayLike, best: int = 1) -> npt.NDArray[np.int64]:
        """Find the best classes.

        Evaluates only the pairs that can matter (about an eighth of 300 pairs for the best class)
        and gives the same result as all pairs.

        Args:
            features: (n, F) or (F,).
            best: How many.

        Returns:
            (n, best) indices of classes, best first, n = 1 for a single row: the order of
            `scores`, and of equal scores the lowest index first.

        Raises:
            UsageError: Features of another shape, or not finite; `best` is not between one and
                the number of classes.
        """
        if not 1 <= best <= self.classes:
            raise UsageError(
                f"best is {best}; expected 1 to {self.classes}, the number of classes of this "
                f"predictor."
            )
        from dynresp.response.prediction import (
            compiled_classifier_kernel as prediction_kernel,
        )

        rows = self._rows(features)
        ranks = np.empty((len(rows), best), dtype=np.int64)
        bad = prediction_kernel.rank_kernels[self._padded.dtype](
            rows, self.projection, self.offset, self._padded, self.classes, ranks
        )
        self._refuse(bad)
        return ranks

    def _rows(self, features: npt.ArrayLike) -> FloatArray:
        """Features as (n, F), contiguous, float64."""
        rows: FloatArray = np.ascontiguousarray(features, dtype=np.float64)
        given = rows.shape
        if rows.ndim == 1:
            rows = rows.reshape(1, -1)
        if rows.ndim != 2 or rows.shape[1] != self.projection.shape[1]:
            raise UsageError(
                f"features have the shape {given}; this predictor expects (n, "
                f"{self.projection.shape[1]}), or ({self.projection.shape[1]},) for a single row."
            )
        return rows

    @staticmethod
    def _refuse(bad: int) -> None:
        if bad >= 0:
            raise UsageError(
                f"features of row {bad} hold NaN, infinity or values that are too large; check "
                f"the simulation they come from."
            )


def _monomial_count(components: int) -> int:
    """Number of monomials up to degree two of this many variables."""
    return 1 + components + components * (components + 1) // 2


def _checked_steps(pipeline: Any) -> tuple[Any, Any, Any]:
    """Scaler, principal components and classifier of a pipeline that can be compiled."""
    require("sklearn")
    from sklearn.decomposition import PCA
    from sklearn.exceptions import NotFittedError
    from sklearn.pipeline import Pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC
    from sklearn.utils.validation import check_is_fitted

    kinds = (StandardScaler, PCA, SVC)
    steps = [step for _, step in pipeline.steps] if isinstance(pipeline, Pipeline) else [pipeline]
    names = ", ".join(type(step).__name__ for step in steps)
    if [type(step) for step in steps] != list(kinds):
        raise UsageError(f"cannot compile {names}; {_EXPECTED}.")
    scaler, pca, svc = steps
    for step, settings in (
        (scaler, {"with_mean": True, "with_std": True}),
        (pca, {"whiten": False}),
        (
            svc,
            {"kernel": "poly", "degree": 2, "break_ties": True, "decision_function_shape": "ovr"},
        ),
    ):
        for name, wanted in settings.items():
            given = getattr(step, name)
            if given != wanted:
                raise UsageError(
                    f"cannot compile {type(step).__name__}({name}={given!r}); {_EXPECTED}."
                )
    for step in steps:
        try:
            check_is_fitted(step)
        except NotFittedError as error:
            raise UsageError(f"the {type(step).__name__} is not fitted; {_EXPECTED}.") from error
    return scaler, pca, svc


def _pair_weights(svc: Any) -> FloatArray:
    """Sum the kernel's expansion over the support vectors of every pair of classes.

    scikit-learn keeps the dual coefficients as (classes - 1, support vectors): for a support vector
    of class i, row r belongs to the pair with class r if r < i, else with class r + 1.
    """
    classes, components = len(svc.classes_), svc.support_vectors_.shape[1]
    # With two classes scikit-learn's coefficients have the opposite sign of libsvm's.
    sign = -1.0 if classes == 2 else 1.0
    weights = np.zeros((classes * (classes - 1) // 2, _monomial_count(components)))
    first = np.concatenate([[0], np.cumsum(svc.n_support_)])
    for i in range(classes):
        others = [j for j in range(classes) if j != i]
        pairs = [_pair_index(min(i, j), max(i, j), classes) for j in others]
        for start in range(first[i], first[i + 1], _CHUNK):
            part = slice(start, min(start + _CHUNK, first[i + 1]))
            terms = _kernel_expansion(svc.support_vectors_[part], svc._gamma, svc.coef0)
            weights[pairs] += sign * (svc.dual_coef_[:, part] @ terms)
    weights[:, 0] += sign * svc.intercept_
    return weights


def _pair_index(i: int, j: int, classes: int) -> int:
    """Index of the pair (i, j), i < j, in the order of the pairs."""
    return i * (2 * classes - i - 1) // 2 + j - i - 1


def _kernel_expansion(vectors: FloatArray, gamma: float, coef0: float) -> FloatArray:
    """Coefficients of (gamma s.z + coef0)^2 over the monomials of z, one row for every s."""
    components = vectors.shape[1]
    i, j = np.triu_indices(components)
    # z_i z_j and z_j z_i are one monomial.
    twice = np.where(i == j, 1.0, 2.0)
    terms = np.empty((len(vectors), _monomial_count(components)))
    terms[:, 0] = coef0**2
    terms[:, 1 : 1 + components] = 2.0 * gamma * coef0 * vectors
    terms[:, 1 + components :] = gamma**2 * twice * vectors[:, i] * vectors[:, j]
    return terms
