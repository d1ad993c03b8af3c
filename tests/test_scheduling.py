"""Tests that share fixtures go to one process, and those that take longest come first."""

import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from tests.tools.scheduling import APART, LONGEST, SERVED, group_of, rank_of
from tests.tools.serving import ROOT, environment

CONFTEST = """
from tests.tools.scheduling import Groups

def pytest_xdist_make_scheduler(config, log):
    return Groups(config, log)
"""
TESTS = """
import os
import pytest

@pytest.mark.parametrize("k", range({number}))
def test_where(k):
    with open({ran!r}, "a") as file:
        file.write("{name} " + os.environ["PYTEST_XDIST_WORKER"] + "\\n")
"""


@pytest.mark.long
def test_the_tests_of_a_file_run_in_one_process_and_files_in_order(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST)
    ran, numbers = tmp_path / "ran", {"a": 6, "b": 6, "c": 12}
    for name, number in numbers.items():
        text = TESTS.format(number=number, ran=str(ran), name=name)
        (tmp_path / f"test_{name}.py").write_text(text)
    command = [sys.executable, "-m", "pytest", "--numprocesses", "2", f"--rootdir={tmp_path}"]
    subprocess.run(
        [*command, "-c", "/dev/null", str(tmp_path)],
        cwd=ROOT,
        env=environment(PYTHONPATH=str(ROOT)),
        check=True,
        stdout=subprocess.DEVNULL,
    )
    lines = [line.split() for line in ran.read_text().splitlines()]
    assert Counter(name for name, _ in lines) == numbers
    assert len({(name, process) for name, process in lines}) == len(numbers)
    assert {process for _, process in lines} == {"gw0", "gw1"}
    assert next(k for k, (name, _) in enumerate(lines) if name == "c") >= 6


def test_what_is_named_to_come_first_or_apart_is_there() -> None:
    for named in (*APART, *LONGEST, *(f"tests/service/test_{name}.py" for name in SERVED)):
        path, _, test = named.partition("::")
        assert (ROOT / path).exists(), named
        assert not test or f"def {test.partition('[')[0]}(" in (ROOT / path).read_text(), named


def test_the_page_has_two_browsers_and_other_files_keep_together() -> None:
    page = [
        group_of(path.relative_to(ROOT).as_posix() + "::test_x")
        for path in (ROOT / "tests" / "page").glob("test_*.py")
    ]
    assert len(set(page)) == 2
    assert 0.3 < page.count(page[0]) / len(page) < 0.7
    one, other = "tests/client/test_client.py::test_a", "tests/client/test_client.py::test_b[1]"
    assert group_of(one) == group_of(other) == "tests/client/test_client.py"
    served = {group_of(f"tests/service/test_{name}.py::test_x") for name in SERVED}
    assert len(served) == 1
    alone = f"{APART[0]}::test_x[1]"
    assert group_of(alone) == alone
    assert rank_of("tests/reports/test_x.py::test_x") == len(LONGEST)
    assert rank_of(f"{LONGEST[1]}[x]") == 1
