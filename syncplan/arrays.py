"""Types of NumPy arrays, and pairs as such; docstrings give shapes and units."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "Flags", "Index", "as_pairs"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Flags = NDArray[np.bool_]


def as_pairs(pairs: Sequence[Sequence[int]]) -> Index:
    """Return the (e, 2) array of a list of pairs, also where the list is empty."""
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)
