"""House rules beyond the layers that import-linter enforces."""

import ast
import importlib
import inspect
import pkgutil
from functools import cache
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


@cache
def modules() -> dict[str, ModuleType]:
    """Return all modules of the library and the service by name."""
    names = [
        found.name
        for package in (syncplan, api)
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
        if not found.name.endswith("__main__")
    ]
    return {name: importlib.import_module(name) for name in names}


def _text(module: ModuleType) -> str:
    return Path(str(module.__file__)).read_text()


def test_every_module_says_what_it_is_for() -> None:
    assert [name for name, module in modules().items() if not (module.__doc__ or "").strip()] == []


def test_public_names_have_docstrings() -> None:
    missing = []
    for name, module in modules().items():
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
        for name, module in modules().items()
        for node in ast.walk(ast.parse(_text(module)))
        if isinstance(node, ast.ImportFrom) and node.level
    ]
    assert relative == []


def test_degrees_appear_only_at_the_edge() -> None:
    outside = []
    for name, module in modules().items():
        if name.startswith(("syncplan.exporting.", "api.")) or name in DEGREES_AT_THE_EDGE:
            continue
        if "degrees(" in _text(module):
            outside.append(name)
    assert outside == []


def test_the_package_offers_what_it_lists() -> None:
    for name in syncplan.__all__:
        assert getattr(syncplan, name) is not None
    with pytest.raises(AttributeError):
        syncplan.nothing  # noqa: B018
