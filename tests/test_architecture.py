"""House rules that import-linter can't hold: names, sizes, what is public and documented."""

import ast
import importlib
import inspect
import pkgutil
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import api
import syncplan
from syncplan.estimation.filters import FILTERS
from syncplan.exporting.format_table import FORMATS
from syncplan.plotting.figure_table import FIGURES
from syncplan.recordings.recording_formats import FORMATS as LAYOUTS

LARGEST_MODULE = 350
LARGEST_FUNCTION = 45
MOST_PUBLIC_NAMES = 13

REASONS: dict[str, str] = {}
"""Modules and functions that are longer, each with the reason."""

DEGREES_AT_THE_EDGE = {
    "syncplan.cli.terminal_tables",
    "syncplan.observability.unobservable_modes",
    "syncplan.orbits.scenario_arrays",
    "syncplan.plotting.canvas",
    "syncplan.scenario.specification",
}
"""Where degrees are turned to radians or back, besides other programs' formats."""


def _modules() -> Iterator[ModuleType]:
    for package in (syncplan, api):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not found.name.endswith("__main__"):
                yield importlib.import_module(found.name)


MODULES = {module.__name__: module for module in _modules()}
TREES = {name: ast.parse(Path(str(one.__file__)).read_text()) for name, one in MODULES.items()}


def _is_package(module: ModuleType) -> bool:
    return hasattr(module, "__path__")


def test_no_two_modules_have_one_name() -> None:
    names = Counter(name.rpartition(".")[2] for name in MODULES)
    assert [name for name, times in names.items() if times > 1] == []


def test_no_two_classes_have_one_name() -> None:
    classes = Counter(
        node.name
        for tree in TREES.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
    )
    assert [name for name, times in classes.items() if times > 1] == []


def test_modules_stay_short() -> None:
    long = {}
    for name, module in MODULES.items():
        lines = len(Path(str(module.__file__)).read_text().splitlines())
        if lines > LARGEST_MODULE and name not in REASONS:
            long[name] = lines
    assert long == {}


def test_functions_stay_short() -> None:
    long = {}
    for name, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lines = _lines_of_code(node)
                if lines > LARGEST_FUNCTION and f"{name}.{node.name}" not in REASONS:
                    long[f"{name}.{node.name}"] = lines
    assert long == {}


def _lines_of_code(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function's body, its docstring left out."""
    body = function.body[1:] if ast.get_docstring(function) else function.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


def test_reasons_are_given_for_what_there_is() -> None:
    functions = {
        f"{name}.{node.name}"
        for name, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }
    assert set(REASONS) <= functions | set(MODULES)
    assert all(REASONS.values())


def test_every_module_says_what_it_is_for() -> None:
    assert [name for name, module in MODULES.items() if not (module.__doc__ or "").strip()] == []


def test_packages_list_their_modules() -> None:
    """In the docstring, a line each, with what it is for; or in a table of kinds."""
    missing = []
    for name, module in MODULES.items():
        parent = MODULES.get(name.rpartition(".")[0])
        if parent is not None and not _is_package(module) and name not in _named_by_tables():
            short = name.rpartition(".")[2]
            listed = [line.split()[:1] for line in (parent.__doc__ or "").splitlines()]
            if parent.__name__.startswith("syncplan.") and [short] not in listed:
                missing.append(name)
    assert missing == []


def _named_by_tables() -> set[str]:
    """Modules of members of tables, which a new member adds to with nothing but its line."""
    formats = (f"syncplan.exporting.{one.writer}" for one in FORMATS.values())
    figures = (f"syncplan.plotting.{one.maker}" for one in FIGURES.values())
    filters = (f"syncplan.estimation.{one.kernel}" for one in FILTERS.values())
    layouts = (f"syncplan.recordings.{one.reader}" for one in LAYOUTS.values())
    return {place.rpartition(".")[0] for place in (*formats, *figures, *filters, *layouts)}


def test_public_names_are_sorted_documented_and_few() -> None:
    faults: list[str] = []
    for name, module in MODULES.items():
        if not _is_package(module) or hasattr(module, "__all__"):
            faults += _faults_of_public_names(name, module)
    assert faults == []


def _faults_of_public_names(name: str, module: ModuleType) -> Iterator[str]:
    public = getattr(module, "__all__", None)
    if public is None:
        yield f"{name} has no __all__"
        return
    if list(public) != sorted(public, key=_as_ruff_sorts):
        yield f"{name}.__all__ is not sorted"
    if len(public) > MOST_PUBLIC_NAMES and not _is_package(module):
        yield f"{name} has {len(public)} public names"
    for one in public:
        thing = getattr(module, one)
        if one == name.rpartition(".")[2]:
            yield f"{name}.{one} is named like its module"
        if (inspect.isclass(thing) or inspect.isfunction(thing)) and not inspect.getdoc(thing):
            yield f"{name}.{one} has no docstring"


def _as_ruff_sorts(name: str) -> tuple[int, str]:
    """Constants, then classes, then functions."""
    return (0 if name.isupper() else 1 if name[0].isupper() else 2), name


def test_imports_are_absolute() -> None:
    relative = [
        name
        for name, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.level
    ]
    assert relative == []


def test_degrees_appear_only_at_the_edge() -> None:
    outside = []
    for name, module in MODULES.items():
        if name.startswith(("syncplan.exporting.", "api.")) or name in DEGREES_AT_THE_EDGE:
            continue
        if "degrees(" in Path(str(module.__file__)).read_text():
            outside.append(name)
    assert outside == []


def test_the_package_offers_what_it_lists() -> None:
    for name in syncplan.__all__:
        assert getattr(syncplan, name) is not None
    with pytest.raises(AttributeError):
        syncplan.nothing  # noqa: B018
