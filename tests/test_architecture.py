"""The house rules that a machine can hold: order of modules, public names, docstrings."""

import ast
import importlib
import inspect
from pathlib import Path

import pytest

import syncplan

PACKAGE = Path(syncplan.__file__).parent

ORDER = (
    "errors",
    "formation",
    "areas",
    "schema_rules",
    "portions",
    "quantities",
    "refine_options",
    "checks",
    "sections",
    "scenario",
    "loading",
    "candidates",
    "blas",
    "cores",
    "children",
    "orbits",
    "trigpoly",
    "contacts",
    "separation",
    "sightings",
    "noise",
    "graph",
    "rules",
    "slack",
    "relaxation",
    "senses",
    "sync",
    "placing.demands",
    "placing.programme",
    "placing.drawing",
    "placing.layouts",
    "placing.obstacles",
    "placement",
    "observability",
    "certificate",
    "motions",
    "connectivity",
    "covariances",
    "bounds",
    "meetings",
    "arcs",
    "ekf",
    "consistency",
    "trials",
    "montecarlo",
    "parts",
    "refining.problem",
    "refining.measures",
    "refining.exact_search",
    "refining.record",
    "refining.blocks",
    "refining.sample_times",
    "refining.smooth_sightings",
    "refining.smooth_contacts",
    "refining.smooth_team",
    "refining.smooth_bound",
    "refining.smooth_objectives",
    "refining.clearances",
    "refining.program",
    "refining.solver",
    "refining.starts",
    "refining.tasks",
    "planner",
    "refining.posing",
    "refinement",
    "siting.information",
    "siting.relaxation",
    "siting.search",
    "landmark_sites",
    "validation",
    "sweeps",
    "document",
    "refinement_report",
    "plan_report",
    "sites_report",
    "validation_report",
    "planfile",
    "client",
    "output",
    "streams",
    "tables",
    "arguments",
    "plan_commands",
    "run_commands",
    "service_commands",
    "cli",
)
"""Modules in the order of data flow: each imports only those before it."""

LIBRARIES = {
    "casadi": {
        "refining.blocks",
        "refining.smooth_sightings",
        "refining.smooth_contacts",
        "refining.smooth_team",
        "refining.smooth_bound",
        "refining.smooth_objectives",
        "refining.clearances",
        "refining.program",
        "refining.solver",
    },
    "cvxpy": {"placing.programme", "relaxation", "siting.relaxation"},
    "networkx": {"graph"},
    "numba": {"ekf"},
    "pydantic": {
        "portions",
        "quantities",
        "refine_options",
        "sections",
        "scenario",
        "loading",
        "candidates",
        "document",
        "sites_report",
        "planfile",
        "refinement",
    },
    "shapely": {"areas"},
    "typer": {"arguments", "plan_commands", "run_commands", "service_commands", "cli"},
}
"""The only modules that may import a library."""

EDGES = {"__init__", "__main__"}
MODULES = sorted(
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
    for path in PACKAGE.rglob("*.py")
    if path.stem not in EDGES
)


def _path(module: str) -> Path:
    return PACKAGE.joinpath(*module.split(".")).with_suffix(".py")


def _imports(module: str) -> set[str]:
    tree = ast.parse(_path(module).read_text())
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{module}: relative import"
            names = {name.name for name in node.names}
            package = PACKAGE.parent.joinpath(*node.module.split("."), "__init__.py").exists()
            found |= {f"{node.module}.{n}" for n in names} if package else {node.module}
    return found


def test_every_module_has_its_place_in_the_order() -> None:
    assert set(MODULES) == set(ORDER)


@pytest.mark.parametrize("module", MODULES)
def test_imports_run_one_way(module: str) -> None:
    for name in _imports(module):
        if name.startswith("syncplan."):
            used = name.removeprefix("syncplan.")
            if used in ORDER:
                assert ORDER.index(used) < ORDER.index(module), f"{module} imports {used}"


@pytest.mark.parametrize("module", MODULES)
def test_libraries_stay_where_they_belong(module: str) -> None:
    for name in _imports(module):
        root = name.split(".")[0]
        assert module in LIBRARIES.get(root, {module}), f"{module} imports {root}"


@pytest.mark.parametrize("module", MODULES)
def test_public_names_are_sorted_documented_and_few(module: str) -> None:
    loaded = importlib.import_module(f"syncplan.{module}")
    assert loaded.__doc__
    names = loaded.__all__
    assert list(names) == sorted(names, key=_as_ruff_sorts)
    assert len(names) <= 13
    for name in names:
        thing = getattr(loaded, name)
        assert name != module.rpartition(".")[2], f"{module}.{name} is named like its module"
        if inspect.isclass(thing) or inspect.isfunction(thing):
            assert inspect.getdoc(thing), f"{module}.{name} has no docstring"


def _as_ruff_sorts(name: str) -> tuple[int, str]:
    """Constants, then classes, then functions."""
    kind = 0 if name.isupper() else 1 if name[0].isupper() else 2
    return kind, name


def test_the_package_offers_what_it_lists() -> None:
    for name in syncplan.__all__:
        assert getattr(syncplan, name) is not None
    with pytest.raises(AttributeError):
        syncplan.nothing  # noqa: B018


@pytest.mark.parametrize("module", MODULES)
def test_degrees_appear_only_at_the_edge(module: str) -> None:
    if module in {"scenario", "document", "planner", "motions", "tables"}:
        return
    assert "degrees(" not in _path(module).read_text()
