"""Compiled functions kept on disk as object code and called without importing numba.

numba takes as long to import as a whole plan of a few vehicles takes to compute. Its compiler,
llvmlite, loads object code in a third of that time. So a function is compiled by numba once, its
object code is written beside the package, and later processes load that.

A compiled function is called as numba calls it: with pointers for the result and for an error, then
each array as seven or more numbers, of which its data, shape and strides are used.
"""

import ctypes
import hashlib
import os
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import FunctionType
from typing import Any, Generic, ParamSpec

import numpy as np

from syncplan.errors import InputError
from syncplan.runtime.files import write_bytes

P = ParamSpec("P")

FOLDER = "object-code"


class ObjectCode(Generic[P]):
    """Function of C-contiguous arrays of float64 or int64, and of integers, returning an integer.

    It is compiled for the arrays of its first call; others must have as many axes. It may call
    others of its module, raises nothing and creates no arrays.
    """

    def __init__(self, function: Callable[P, int]) -> None:
        self.function = function
        self._compiled: Any = None
        self._loading = threading.Lock()

    def __call__(self, *arguments: P.args, **named: P.kwargs) -> int:
        """Return the function's result."""
        if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
            return self.function(*arguments, **named)
        # once: a second one would take away the code that the first caller is running
        with self._loading:
            if self._compiled is None:
                self._compiled = self._loaded(arguments)
        result, error = ctypes.c_int64(), ctypes.c_void_p()
        passed = [part for one in arguments for part in _flat(one)]
        self._compiled[0](ctypes.byref(result), ctypes.byref(error), *passed)
        return result.value

    def _loaded(self, arguments: tuple[Any, ...]) -> tuple[Any, ...]:
        import llvmlite
        import llvmlite.binding as llvm

        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        module: Any = self.function.__code__
        source = Path(module.co_filename)
        machine = (llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
        digest = hashlib.sha256(source.read_bytes())
        digest.update(repr((llvmlite.__version__, *machine)).encode())
        name = f"{source.stem}.{module.co_name}"
        path = _folder() / f"{name}-{digest.hexdigest()[:16]}"
        try:
            symbol, _, code = path.read_bytes().partition(b"\n")
        except OSError:
            symbol, code = self._compile(arguments)
            with suppress(OSError, InputError):
                path.parent.mkdir(parents=True, exist_ok=True)
                for old in path.parent.glob(f"{name}-*"):
                    old.unlink(missing_ok=True)
                write_bytes(path, symbol + b"\n" + code)
        engine = llvm.create_mcjit_compiler(
            llvm.parse_assembly(""),
            llvm.Target.from_default_triple().create_target_machine(jit=True),
        )
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        address = engine.get_function_address(symbol.decode())
        # the engine owns the code
        return ctypes.CFUNCTYPE(ctypes.c_int32)(address), engine

    def _compile(self, arguments: tuple[Any, ...]) -> tuple[bytes, bytes]:
        """Return the symbol and the object code of the function for arguments of these types."""
        import numba

        compiler: Any = numba
        types = tuple(compiler.typeof(one) for one in arguments)
        dispatcher = self._dispatcher(compiler)
        dispatcher.compile(types)
        (compiled,) = dispatcher.overloads.values()
        symbol: str = compiled.fndesc.llvm_func_name
        return symbol.encode(), bytes(compiled.library._get_compiled_object())

    def _dispatcher(self, compiler: Any) -> Any:
        function: Any = self.function
        called = {
            name: one._dispatcher(compiler)
            for name, one in function.__globals__.items()
            if isinstance(one, ObjectCode) and name in function.__code__.co_names
        }
        linked = FunctionType(function.__code__, {**function.__globals__, **called})
        return compiler.njit(
            nogil=True,
            error_model="numpy",
            fastmath={"contract"},
            _nrt=False,
            no_cpython_wrapper=True,
            no_cfunc_wrapper=True,
        )(linked)


def _flat(argument: Any) -> list[Any]:
    """The numbers that a compiled function takes for an argument."""
    if not isinstance(argument, np.ndarray):
        return [ctypes.c_int64(argument)]
    if not argument.flags.c_contiguous or argument.dtype not in (np.float64, np.int64):
        raise TypeError(f"not a contiguous array of float64 or int64: {argument.dtype}")
    sizes = (argument.size, argument.itemsize)
    data = ctypes.c_void_p(argument.ctypes.data)
    shape = (*argument.shape, *argument.strides)
    none = ctypes.c_void_p()
    return [none, none, *map(ctypes.c_int64, sizes), data, *map(ctypes.c_int64, shape)]


def _folder() -> Path:
    """The folder of object code: beside the package, or where its user's caches are."""
    package = Path(__file__).parents[1]
    if asked := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(asked) / FOLDER
    if os.access(package, os.W_OK):
        return package / "__pycache__" / FOLDER
    if kept := os.environ.get("XDG_CACHE_HOME"):
        return Path(kept) / "syncplan" / FOLDER
    with suppress(RuntimeError):
        return Path.home() / ".cache" / "syncplan" / FOLDER
    # a user without a home: nothing can be kept
    return Path(os.devnull) / FOLDER
