"""Kernels that are built into others, to be called by themselves."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def called_alone(function: Function) -> Function:
    """Return an `inner` kernel as one that Python can call."""
    compiled: Any = numba.njit(lambda *arguments: function(*arguments), error_model="numpy")
    return compiled  # type: ignore[no-any-return]
