"""Archive of trials: a part of a Monte Carlo run as bytes, an .npz file of plain arrays."""

import io
from dataclasses import MISSING, fields
from typing import Any
from zipfile import BadZipFile

import numpy as np

from syncplan.errors import InputError
from syncplan.estimation.trials import Branch, MonteCarloResult

_BRANCHES = "branches"


def pack(part: MonteCarloResult) -> bytes:
    """Return a part as bytes that hold every bit of it."""
    arrays: dict[str, Any] = {
        field.name: np.asarray(getattr(part, field.name))
        for field in fields(part)
        if field.name != _BRANCHES
    }
    arrays["places"] = np.array(
        [(branch.level, branch.index) for branch in part.branches], dtype=np.int64
    ).reshape(-1, 2)
    for k, branch in enumerate(part.branches):
        arrays[f"sums_{k}"], arrays[f"error_sums_{k}"] = branch.sums, branch.error_sums
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def unpack(data: bytes) -> MonteCarloResult:
    """Return the part that `pack` turned into bytes; raises InputError for other bytes.

    Parts packed before there were further states load as parts without any.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            places = stored["places"].tolist()
            branches = tuple(
                Branch(level, index, stored[f"sums_{k}"], *_later(stored, f"error_sums_{k}"))
                for k, (level, index) in enumerate(places)
            )
            values = {
                field.name: _value(stored[field.name])
                for field in fields(MonteCarloResult)
                if field.name != _BRANCHES
                and (field.name in stored or field.default_factory is MISSING)
            }
    except (OSError, EOFError, BadZipFile, ValueError, KeyError) as error:
        raise InputError(f"not a part of a run: {error}", key="parts") from None
    return MonteCarloResult(branches=branches, **values)


def _later(stored: Any, name: str) -> list[Any]:
    """An array that older archives have not: none or one."""
    return [stored[name]] if name in stored else []


def _value(stored: Any) -> Any:
    """A scalar as Python's own number, an array as it is."""
    return stored.item() if stored.ndim == 0 else stored
