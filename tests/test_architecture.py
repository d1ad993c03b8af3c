"""House rules beyond the layers that import-linter enforces."""

import ast
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import api
import syncplan

DEGREES_AT_THE_EDGE = {
    "syncplan.cli.plan_tables",
    "syncplan.observability.unobservable_modes",
    "syncplan.orbits.team",
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


def test_every_module_says_what_it_is_for() -> None:
    assert [name for name, module in MODULES.items() if not (module.__doc__ or "").strip()] == []


def test_public_names_have_docstrings() -> None:
    missing = []
    for name, module in MODULES.items():
        for one in getattr(module, "__all__", None) or _defined_in(module):
            thing = getattr(module, one)
            if (inspect.isclass(thing) or inspect.isfunction(thing)) and not inspect.getdoc(thing):
                missing.append(f"{name}.{one}")
    assert missing == []


def _defined_in(module: ModuleType) -> list[str]:
    names = [name for name in vars(module) if not name.startswith("_")]
    return [one for one in names if getattr(vars(module)[one], "__module__", "") == module.__name__]


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
