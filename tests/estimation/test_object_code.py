"""Compiled functions that are kept on disk and called without numba."""

import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.estimation import object_code
from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.object_code import ObjectCode
from syncplan.planning.planner import plan
from tests.tools.scenarios import small

PLANNED = """
import sys
import syncplan
from tests.tools.scenarios import small
print(repr(syncplan.plan(small(duration_s=20.0)).prediction.rms.tolist()), "numba" in sys.modules)
"""


@ObjectCode
def _twice(values: Array, count: int) -> int:
    for k in range(count):
        values[k] *= 2.0
    return count


@ObjectCode
def _four_times(values: Array, count: int) -> int:
    return _twice(values, count) + _twice(values, count)


def test_functions_that_call_others_change_arrays_and_return_integers() -> None:
    values = np.arange(3.0)
    assert _four_times(values, 2) == 4
    np.testing.assert_array_equal(values, [0.0, 4.0, 2.0])


def test_threads_that_call_it_first_at_the_same_moment_load_it_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # code that is loaded twice is taken away from under the thread that runs it: a crash
    function, loaded, threads = ObjectCode(_twice.function), [], 8
    load, ready = ObjectCode._loaded, threading.Barrier(threads)

    def slowly(one: ObjectCode[Any], arguments: tuple[Any, ...]) -> tuple[Any, ...]:
        loaded.append(one)
        time.sleep(0.05)
        return load(one, arguments)

    def call(_: int) -> int:
        ready.wait()
        return function(np.ones(2), 2)

    monkeypatch.setattr(ObjectCode, "_loaded", slowly)
    with ThreadPoolExecutor(threads) as pool:
        assert list(pool.map(call, range(threads))) == [2] * threads
    assert loaded == [function]


def test_arrays_of_another_kind_are_refused() -> None:
    wrongs: list[Any] = [np.arange(4.0)[::2], np.arange(3, dtype=np.int32)]
    for wrong in wrongs:
        with pytest.raises(TypeError, match="not a contiguous array of float64 or int64"):
            _twice(wrong, 1)


def test_what_is_compiled_is_kept_for_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert ObjectCode(_twice.function)(np.ones(2), 2) == 2
    (kept,) = (tmp_path / object_code.FOLDER).iterdir()
    assert kept.name.startswith("test_object_code._twice-")
    monkeypatch.delattr(ObjectCode, "_compile")
    values = np.ones(2)
    assert ObjectCode(_twice.function)(values, 2) == 2
    np.testing.assert_array_equal(values, 2.0)


def test_a_second_process_computes_the_same_without_numba() -> None:
    # this one compiles what is not kept
    first = plan(small(duration_s=20.0)).prediction.rms
    kept = {path.name.split("-")[0] for path in object_code._folder().iterdir()}
    assert kept >= {"covariances._along", "referred_system._refer"}
    command = [sys.executable, "-c", PLANNED]
    second = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert first is not None
    assert second.strip() == f"{first.tolist()!r} False"


def test_where_nothing_can_be_written_functions_are_compiled_each_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", os.devnull)
    values = np.ones(2)
    assert ObjectCode(_twice.function)(values, 2) == 2
    np.testing.assert_array_equal(values, 2.0)


def test_a_user_without_a_home_keeps_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert object_code._folder() == Path(os.devnull) / object_code.FOLDER


def test_compiled_functions_compute_what_python_does(monkeypatch: pytest.MonkeyPatch) -> None:
    made = plan(small(duration_s=5.0), bound="never")
    compiled = posterior_bound(made.team, made.windows, 5.0, start_up=True)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    plain = posterior_bound(made.team, made.windows, 5.0, start_up=True)
    np.testing.assert_allclose(compiled.position_variance, plain.position_variance, rtol=1e-10)
    assert compiled.start_up is not None
    assert plain.start_up is not None
    assert compiled.start_up.value == pytest.approx(plain.start_up.value, rel=1e-10)
