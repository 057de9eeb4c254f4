"""Arrays of compiled loops that grow.

Importing this module imports numba; import it where it is used.
"""

from __future__ import annotations

import numpy as np

from dynresp.support.compiling import helper


@helper
def doubled(array):
    """An array of twice as many rows that begins with those of another; the rest is not set."""
    more = np.empty((2 * len(array), *array.shape[1:]), array.dtype)
    more[: len(array)] = array
    return more
