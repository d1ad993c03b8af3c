"""Types of NumPy arrays, and helpers for them; docstrings give shapes and units."""

from collections.abc import Sequence
from dataclasses import MISSING, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Flags = NDArray[np.bool_]


def as_pairs(pairs: Sequence[Sequence[int]]) -> Index:
    """Return the (e, 2) array of a list of pairs, even if the list is empty."""
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def short_repr(record: Any) -> str:
    """Return the repr of a dataclass in one line, each array as its shape: `radii=(6,)`.

    Fields that have their default are left out.
    """
    shown = []
    for one in fields(record):
        value = getattr(record, one.name)
        usual = one.default if one.default_factory is MISSING else one.default_factory()
        if usual is not MISSING and np.all(value == usual):
            continue
        text = str(value.shape) if isinstance(value, np.ndarray) else repr(value)
        shown.append(f"{one.name}={text}")
    return f"{type(record).__name__}({', '.join(shown)})"
