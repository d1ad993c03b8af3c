"""What takes long is computed once for all processes of a run of the tests."""

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest

from tests.tools.kept_values import FOLDER, once_a_run

computed: list[tuple[int, int]] = []


def total(first: int, second: int = 0) -> int:
    computed.append((first, second))
    # long enough for others to want it meanwhile
    time.sleep(0.2)
    return first + second


def test_a_value_is_computed_once_for_the_same_arguments(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    computed.clear()
    begin = Barrier(3)

    def as_a_process_does(_: int) -> list[int]:
        kept = once_a_run(total)
        begin.wait()
        return [kept(1), kept(1), kept(1, second=2), kept(3, 4)]

    with ThreadPoolExecutor(3) as threads:
        assert list(threads.map(as_a_process_does, range(3))) == [[1, 1, 3, 7]] * 3
    assert sorted(computed) == [(1, 0), (1, 2), (3, 4)]


def test_without_a_folder_each_process_computes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(FOLDER)
    computed.clear()
    kept, of_another = once_a_run(total), once_a_run(total)
    assert kept(1) == kept(1) == of_another(1) == 1
    assert computed == [(1, 0), (1, 0)]
