"""Mutants: one operator, number or condition of the code changed, and whether the tests notice.

    python -m tests.tools.mutants
    python -m tests.tools.mutants api --number 100 --seed 1 --checkout ../before

Prints each mutant with the test that killed it, or as a survivor, and the share that was killed
with its 95 % interval. The same seed draws the same mutants of two checkouts, but for lines that
only one of them has. A mutant is killed where `make check`'s tests fail, those of its own package
first, or take longer than --timeout s; with --own, where those of its package do. Its copy of the
checkout is thrown away; the interpreter is the one that runs this.
"""

import argparse
import ast
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from scipy.stats import binomtest

__all__ = ["Mutant", "main", "mutants_of", "shuffled"]

SWAPPED = {
    "Add": "-", "Sub": "+", "Mult": "/", "Div": "*", "FloorDiv": "*", "Mod": "*", "Pow": "*",
    "Lt": "<=", "LtE": "<", "Gt": ">=", "GtE": ">", "Eq": "!=", "NotEq": "==",
    "Is": "is not", "IsNot": "is", "In": "not in", "NotIn": "in", "And": "or", "Or": "and",
}  # fmt: skip


class Mutant(NamedTuple):
    """A change: bytes `begin` to `end` of a file become `new`."""

    path: Path
    begin: int
    end: int
    new: str


def mutants_of(path: Path) -> Iterator[Mutant]:
    """Yield the mutants of a file, in order."""
    source = path.read_bytes()
    lines = [0]
    for line in source.splitlines(keepends=True):
        lines.append(lines[-1] + len(line))
    tree = ast.parse(source)
    notes = {
        id(part)
        for node in ast.walk(tree)
        for note in (getattr(node, "annotation", None), getattr(node, "returns", None))
        if note is not None
        for part in ast.walk(note)
    }

    def at(line: int, column: int) -> int:
        return lines[line - 1] + column

    def between(left: ast.expr, right: ast.expr, operator: ast.AST) -> Mutant:
        begin = at(left.end_lineno or 0, left.end_col_offset or 0)
        end = at(right.lineno, right.col_offset)
        # brackets around the operands stay
        held = source[begin:end].decode()
        gap = re.fullmatch(r"([\s)]*)(.*?)([\s(]*)", held, re.DOTALL)
        assert gap is not None
        return Mutant(path, begin, end, gap[1] + SWAPPED[type(operator).__name__] + gap[3])

    for node in ast.walk(tree):
        if id(node) in notes:
            continue
        if isinstance(node, ast.BinOp) and type(node.op).__name__ in SWAPPED:
            yield between(node.left, node.right, node.op)
        elif isinstance(node, ast.BoolOp):
            yield between(node.values[0], node.values[1], node.op)
        elif isinstance(node, ast.Compare):
            yield between(node.left, node.comparators[0], node.ops[0])
        elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            value = node.value
            new = repr(not value) if isinstance(value, bool) else repr(value + 1)
            begin = at(node.lineno, node.col_offset)
            yield Mutant(path, begin, at(node.end_lineno or 0, node.end_col_offset or 0), new)
        elif isinstance(node, ast.If | ast.While | ast.IfExp):
            begin = at(node.test.lineno, node.test.col_offset)
            end = at(node.test.end_lineno or 0, node.test.end_col_offset or 0)
            yield Mutant(path, begin, end, f"(not ({source[begin:end].decode()}))")


def shuffled(checkout: Path, folders: Iterable[str], seed: int) -> list[Mutant]:
    """Return all mutants in an order that other lines of their files do not change."""
    ranked = []
    for folder in folders:
        for path in sorted((checkout / folder).rglob("*.py")):
            source, name = path.read_bytes(), path.relative_to(checkout)
            for mutant in mutants_of(path):
                begin = source.rfind(b"\n", 0, mutant.begin) + 1
                line = source[begin : source.find(b"\n", mutant.end)]
                place = f"{seed} {name} {mutant.begin - begin} {mutant.new} ".encode()
                rank = hashlib.sha256(place + line).digest()
                ranked.append((rank, mutant._replace(path=name)))
    # what stands twice in a file is there twice
    return [mutant for _, mutant in sorted(ranked)]


def killer_of(mutant: Mutant, copy: Path, given: argparse.Namespace) -> str:
    """Return the test that kills a mutant, "" for none; the file is as before afterwards."""
    path = copy / mutant.path
    before = path.read_bytes()
    path.write_bytes(before[: mutant.begin] + mutant.new.encode() + before[mutant.end :])
    package = "service" if mutant.path.parts[0] == "api" else mutant.path.parts[1]
    own = [f"tests/{package}"] if (copy / "tests" / package).is_dir() else []
    try:
        for places in [own, [] if own and given.own else ["tests"]]:
            if places and (killer := _failure(places, copy, given)):
                return killer
    finally:
        path.write_bytes(before)
    return ""


def _failure(places: list[str], copy: Path, given: argparse.Namespace) -> str:
    """Return the first test that fails, "" for none."""
    try:
        done = subprocess.run(
            [
                *(sys.executable, "-m", "pytest", "-qx", "-p", "no:cacheprovider", *places),
                *("-m", given.marks, "--numprocesses", str(given.processes)),
            ],
            cwd=copy,
            env={**os.environ, "PYTHONPATH": str(copy), "OPENBLAS_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
            timeout=given.timeout,
        )
    except subprocess.TimeoutExpired:
        return "timeout"
    failed = re.search(r"^(?:FAILED|ERROR) (.*?)(?: - |$)", done.stdout, re.MULTILINE)
    return "" if done.returncode == 0 else failed[1] if failed else "no test could be run"


def main() -> None:
    """Print mutants and what became of each."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folders", nargs="*", default=["syncplan", "api"])
    parser.add_argument("--number", type=int, default=24)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--timeout", type=float, default=1800.0)
    parser.add_argument("--own", action="store_true", help="only the tests of a mutant's package")
    parser.add_argument("--marks", default="not long and not documented")
    parser.add_argument("--processes", type=int, default=3, help="of the tests")
    parser.add_argument("--checkout", type=Path, default=Path())
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        unneeded = shutil.ignore_patterns(".git", ".venv", "build", "__pycache__", ".*_cache")
        shutil.copytree(given.checkout, copy, ignore=unneeded)
        if wrong := _failure(["--collect-only", "tests"], copy, given):
            sys.exit(f"the checkout's tests can't be collected without a mutant: {wrong}")
        mutants = shuffled(copy, given.folders, given.seed)
        drawn = mutants[: given.number]
        killed = 0
        for number, mutant in enumerate(drawn, 1):
            source = (copy / mutant.path).read_bytes()
            line = source.count(b"\n", 0, mutant.begin) + 1
            old = source[mutant.begin : mutant.end].decode().strip()
            killer = killer_of(mutant, copy, given)
            killed += bool(killer)
            fate = f"killed by {killer}" if killer else "SURVIVED"
            print(f"{mutant.path}:{line}: {old} -> {mutant.new.strip()}: {fate}", flush=True)
            print(f"{killed} of {number} killed", file=sys.stderr, end="\r", flush=True)
        interval = binomtest(killed, len(drawn)).proportion_ci(method="wilson")
        print(
            f"{killed} of {len(drawn)} mutants killed ({interval.low:.0%} to {interval.high:.0%}), "
            f"of {len(mutants)} that there are"
        )


if __name__ == "__main__":
    main()
