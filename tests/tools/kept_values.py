"""Values that take long to compute, kept for all processes of one run of the tests."""

import fcntl
import hashlib
import os
import pickle
from collections.abc import Callable
from functools import lru_cache, wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

__all__ = ["FOLDER", "once_a_run"]

FOLDER = "TESTS_KEEP_VALUES_IN"
"""Variable of the environment with the folder of the run; without it, each process has its own."""

P = ParamSpec("P")
T = TypeVar("T")


def once_a_run(function: Callable[P, T]) -> Callable[P, T]:
    """Have a function of plain arguments computed once for each, by one process for all."""

    @wraps(function)
    def kept(*arguments: P.args, **named: P.kwargs) -> T:
        folder = os.environ.get(FOLDER)
        if folder is None:
            return function(*arguments, **named)
        called = (
            f"{function.__module__} {function.__qualname__} {arguments} {sorted(named.items())}"
        )
        path = Path(folder) / hashlib.sha256(called.encode()).hexdigest()
        # whoever comes second waits for the first
        with path.open("a+b") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            file.seek(0)
            if text := file.read():
                value: T = pickle.loads(text)
                return value
            value = function(*arguments, **named)
            file.write(pickle.dumps(value))
            return value

    return lru_cache(maxsize=None)(kept)  # type: ignore[return-value]
