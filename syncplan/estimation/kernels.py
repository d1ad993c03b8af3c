"""Compilation and caching of functions, and the lanes that they run over.

A trial is a *lane*: the last, contiguous axis of every array, and arithmetic runs over lanes in
vector registers. Lanes are independent and no sum is reordered, so a trial's figures depend
neither on the lanes beside it nor on their number.
"""

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numpy.typing import NDArray

from syncplan.runtime.machine import usable_cores

WIDE_LANES = 16
"""Trials filtered side by side: four times as fast as one by one for 6 vehicles."""

WIDE_UP_TO = 60
"""Largest team filtered in wide lanes; above it they gain nothing and take 16 times the memory."""

Lanes = NDArray[np.int8] | tuple[int]
"""Lanes of a kernel: only the length counts, which is the number of lanes.

One lane is passed as the tuple (0,): the compiler knows the length of a tuple, the loop over lanes
vanishes and the loop over columns vectorises instead. More lanes are passed as an array, and the
loop over lanes vectorises.
"""

Function = TypeVar("Function", bound=Callable[..., Any])

_njit: Any = partial(numba.njit, nogil=True, error_model="numpy")


class _Apart(CompilerBase):
    """Numba's compiler, for functions whose arrays do not overlap."""

    def define_pipelines(self) -> list[Any]:
        with suppress(AttributeError):  # a numba without the flag: slower code, the same results
            self.state.flags.noalias = True
        passes: Any = DefaultPassBuilder
        return [passes.define_nopython_pipeline(self.state)]


def _folder() -> str:
    """Return the folder of compiled kernels, named by a digest of the sources; "" for numba's own.

    numba compiles a kernel again if its own file has changed, but not if the file of a kernel that
    it calls has. An installation that cannot be written to does not change.
    """
    package = Path(__file__).parents[1]
    asked: Any = numba.config
    if not asked.CACHE_DIR and not os.access(package, os.W_OK):
        return ""
    digest = hashlib.sha256()
    for path in sorted(package.glob("estimation/*.py")) + sorted(package.glob("guidance/*.py")):
        digest.update(path.read_bytes())
    own = package / "__pycache__" / f"kernels-{digest.hexdigest()[:16]}"
    if asked.CACHE_DIR:
        return str(Path(asked.CACHE_DIR) / own.name)
    for other in own.parent.glob("kernels-*"):
        if other != own:
            shutil.rmtree(other, ignore_errors=True)
    return str(own)


_FOLDER = _folder()


def _kept(function: Function, **options: Any) -> Function:
    """Return the function, compiled at its first call and cached in the folder."""
    config: Any = numba.config
    before, config.CACHE_DIR = config.CACHE_DIR, _FOLDER
    try:
        return cast(Function, _njit(cache=True, no_cfunc_wrapper=True, **options)(function))
    finally:
        config.CACHE_DIR = before


def kernel(function: Function) -> Function:
    """Return the function, compiled at its first call and cached on disk."""
    return _kept(function)


def lean(function: Function) -> Function:
    """Return a kernel that creates no arrays, so that references to arrays are not counted.

    Counting takes about as long as the arithmetic of a sighting, since a record passed to a kernel
    has dozens of arrays.
    """
    return _kept(function, _nrt=False)


def fused(function: Function) -> Function:
    """Return a lean kernel in which a product and a sum may be one operation, rounded once."""
    return _kept(function, _nrt=False, fastmath={"contract"})


def linked(function: Function) -> Function:
    """Return a lean kernel that other kernels call, but Python does not.

    Making a kernel callable from Python takes a tenth of its compile time.
    """
    return _kept(function, _nrt=False, no_cpython_wrapper=True)


def inner(function: Function) -> Function:
    """Return a kernel with loops over lanes that is inlined into the kernels that call it.

    It creates no arrays, and no array that it writes to may overlap another of its arrays. So the
    compiler need not check that before each of its short loops.
    """
    compiled = _njit(
        forceinline=True,
        pipeline_class=_Apart,
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        _nrt=False,
    )
    return cast(Function, compiled(function))


def part(function: Function) -> Function:
    """Return a kernel whose statements become those of the kernels that call it.

    For kernels that call others: each separately compiled level of calls is optimised once more.
    """
    return cast(Function, _njit(inline="always")(function))


@contextmanager
def compiled_beside(function: str, vehicles: int) -> Iterator[None]:
    """Compile further kernels in a second process meanwhile, if there is a core for it.

    The process imports `function`, "module:name", and calls it with the number of vehicles. Kernels
    that it has not cached by then are compiled here.
    """
    module, _, name = function.partition(":")
    call = f"from {module} import {name}; {name}({vehicles})"
    begin = f"from syncplan.runtime.child_processes import begin; begin({os.getpid()})"
    code = f"import sys; sys.path[:] = {sys.path!r}; {begin}; {call}"
    unheard: dict[str, Any] = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    beside: AbstractContextManager[Any] = nullcontext()
    with suppress(OSError):
        if usable_cores() > 1:
            beside = subprocess.Popen([sys.executable, "-P", "-c", code], **unheard)
    with beside:
        yield


def lanes_for(n: int) -> int:
    """Return the best number of trials of n vehicles to filter side by side."""
    return WIDE_LANES if n <= WIDE_UP_TO else 1


def lanes_of(n: int, width: int) -> Lanes:
    """Return the lanes of `width` trials of n vehicles, in the form that kernels take."""
    return (0,) if width == lanes_for(n) == 1 else np.zeros(width, dtype=np.int8)


def compile_for(kernel: Any, *arguments: Any) -> None:
    """Compile a kernel for arguments of these types, or load it from numba's disk cache."""
    typeof: Any = numba.typeof
    kernel.compile(tuple(typeof(argument) for argument in arguments))


def has_compiled(kernel: Any, arguments: tuple[Any, ...] | None = None) -> bool:
    """Return whether a kernel for arguments of these types is in memory or in numba's disk cache.

    For any arguments if None. True where numba is switched off; False where the layout of its cache
    differs from the one read here.
    """
    config: Any = numba.config
    if config.DISABLE_JIT:
        return True
    typeof: Any = numba.typeof
    types = None if arguments is None else tuple(typeof(argument) for argument in arguments)
    try:
        known = [
            *kernel.overloads,
            *(tuple(key[0]) for key in kernel._cache._cache_file._load_index()),
        ]
        return bool(known) if types is None else types in known
    except (AttributeError, TypeError, IndexError, OSError):
        return False
