"""Types of arrays, and making arrays read-only."""

from __future__ import annotations

from typing import Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

BoolArray: TypeAlias = npt.NDArray[np.bool_]
IntArray: TypeAlias = npt.NDArray[np.int32]
LongArray: TypeAlias = npt.NDArray[np.int64]
IndexArray: TypeAlias = npt.NDArray[np.intp]

_Scalar = TypeVar("_Scalar", bound=np.generic)


def frozen(array: npt.NDArray[_Scalar]) -> npt.NDArray[_Scalar]:
    """The same array, made read-only, since it is shared."""
    array.flags.writeable = False
    return array


def sparse_graph(
    weights: npt.ArrayLike, starts: npt.ArrayLike, stops: npt.ArrayLike, nodes: int
) -> Any:
    """A sparse matrix of edges for `scipy.sparse.csgraph`.

    Its indices are 32 bits wide: some versions of SciPy refuse wider ones there.

    Args:
        weights: (k,) of the edges.
        starts: (k,) node at which each begins.
        stops: (k,) node at which it ends.
        nodes: How many nodes there are.
    """
    from scipy.sparse import csr_array

    ends = (np.asarray(starts, dtype=np.int32), np.asarray(stops, dtype=np.int32))
    data: Any = (np.asarray(weights), ends)
    return csr_array(data, shape=(nodes, nodes))
