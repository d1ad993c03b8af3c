"""The house rules that a machine can hold: order of modules, public names, docstrings."""

import ast
import importlib
import inspect
from collections.abc import Iterator
from pathlib import Path

import pytest

import api
import syncplan

PACKAGE = Path(syncplan.__file__).parent
API = Path(api.__file__).parent

ORDER = (
    "errors",
    "formation",
    "areas",
    "schema_rules",
    "portions",
    "quantities",
    "georeference",
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
    "slips",
    "meetings",
    "arcs",
    "ekf",
    "consistency",
    "trials",
    "montecarlo",
    "parts",
    "logs",
    "replays",
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
    "replay_report",
    "planfile",
    "plotting.palette",
    "plotting.canvas",
    "plotting.standing",
    "plotting.maps",
    "plotting.formation",
    "plotting.animation",
    "plotting.timeline",
    "plotting.spectrum",
    "plotting.accuracy",
    "plotting.errors",
    "plotting.consistency",
    "plotting.sweep",
    "plotting.comparison",
    "plotting.catalogue",
    "plotting.page",
    "plotting.images",
    "figures",
    "remote",
    "client",
    "output",
    "exporting.options",
    "exporting.files",
    "exporting.names",
    "exporting.geodesy",
    "exporting.flight",
    "exporting.items",
    "exporting.loiter_turns",
    "exporting.polygons",
    "exporting.missions",
    "exporting.qgc",
    "exporting.ardupilot",
    "exporting.poses",
    "exporting.bags",
    "exporting.crazyswarm",
    "exporting.maps",
    "exporting.geojson",
    "exporting.kml",
    "exporting.sync_document",
    "exporting.joining",
    "exporting.sidecar",
    "exports",
    "streams",
    "tables",
    "arguments",
    "plan_commands",
    "run_commands",
    "plot_commands",
    "export_commands",
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
    "kaleido": {"plotting.images"},
    "networkx": {"graph"},
    "numba": {"ekf"},
    "plotly": {"figures", "plotting.page"},
    "pydantic": {
        "portions",
        "quantities",
        "georeference",
        "refine_options",
        "sections",
        "scenario",
        "loading",
        "candidates",
        "document",
        "sites_report",
        "planfile",
        "refinement",
        "plot_commands",
        "exporting.sync_document",
    },
    "pymap3d": {"exporting.geodesy"},
    "rosbags": {"exporting.bags"},
    "shapely": {"areas"},
    "typer": {
        "arguments",
        "plan_commands",
        "run_commands",
        "plot_commands",
        "export_commands",
        "service_commands",
        "cli",
    },
}
"""The only modules that may import a library."""

API_ORDER = (
    "keys",
    "settings",
    "logs",
    "problems.document",
    "problems.errors",
    "problems.table",
    "problems.openapi",
    "problems.handling",
    "metrics",
    "negotiation",
    "security",
    "telemetry",
    "limits",
    "requests",
    "computing.inputs",
    "computing.tasks",
    "computing.renditions",
    "computing.child",
    "computing.pool",
    "storage.tables",
    "storage.migrations",
    "storage.database",
    "storage.plans",
    "storage.events",
    "storage.jobs",
    "storage.old_jobs",
    "storage.work",
    "storage.parts",
    "storage.answers",
    "storage.executors",
    "jobs.runtime",
    "jobs.cuts",
    "jobs.queue",
    "jobs.workflows",
    "jobs.guard",
    "jobs.worker",
    "answers",
    "service",
    "calls",
    "routes.plans",
    "routes.jobs",
    "routes.figures",
    "routes.exports",
    "routes.schemas",
    "routes.health",
    "assets",
    "routes.page",
    "operations",
    "openapi",
    "main",
    "protocol",
    "server",
)
"""Modules of the service, which come after all of syncplan: each imports only those before it."""

API_LIBRARIES = {
    "dbos": {"jobs.queue", "jobs.workflows", "jobs.guard", "jobs.worker"},
    "prometheus_client": {"metrics"},
    "pydantic_settings": {"settings"},
}
"""The only modules of the service that may import a library."""

NUMERICS = {"casadi", "clarabel", "cvxpy", "networkx", "numba", "numpy", "osqp", "scipy", "shapely"}
"""Libraries that the service leaves to syncplan."""

SERVICE_COMMANDS = "service_commands"
"""The one module of syncplan that may import the service, and only inside functions."""

EDGES = {"__init__", "__main__"}


def _modules(package: Path) -> list[str]:
    return sorted(
        ".".join(path.relative_to(package).with_suffix("").parts)
        for path in package.rglob("*.py")
        if path.stem not in EDGES
    )


MODULES = _modules(PACKAGE)
API_MODULES = _modules(API)


def _path(module: str, package: Path = PACKAGE) -> Path:
    return package.joinpath(*module.split(".")).with_suffix(".py")


def _imports(module: str, package: Path = PACKAGE) -> set[str]:
    return set(_imported(ast.parse(_path(module, package).read_text()), module))


def _imported(tree: ast.AST, module: str, *, lazily: bool = True) -> Iterator[str]:
    """What a module imports, with or without what only its functions import."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{module}: relative import"
            is_package = PACKAGE.parent.joinpath(*node.module.split("."), "__init__.py").exists()
            names = [f"{node.module}.{name.name}" for name in node.names]
            yield from names if is_package else [node.module]
        if lazily or not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from _imported(node, module, lazily=lazily)


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
    _check_public_names(f"syncplan.{module}")


def _check_public_names(module: str) -> None:
    loaded = importlib.import_module(module)
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
    if module in {"scenario", "document", "planner", "motions", "tables", "plotting.canvas"}:
        return
    if module.startswith("exporting."):
        # other programs' formats
        return
    assert "degrees(" not in _path(module).read_text()


def test_every_module_of_the_service_has_its_place_in_the_order() -> None:
    assert set(API_MODULES) == set(API_ORDER)
    assert len(API_ORDER) == len(set(API_ORDER))


@pytest.mark.parametrize("module", API_MODULES)
def test_imports_of_the_service_run_one_way(module: str) -> None:
    place = API_ORDER.index(module)
    for name in _imports(module, API):
        if name.split(".")[0] == "api":
            for used in _api_modules_behind(name):
                assert API_ORDER.index(used) < place, f"{module} imports {used}"


def _api_modules_behind(name: str) -> list[str]:
    """The module imported, or all those of a package that a name is imported from."""
    inner = name.removeprefix("api.")
    if inner in API_ORDER:
        return [inner]
    family = inner.rpartition(".")[0]
    found = [module for module in API_ORDER if family and module.startswith(f"{family}.")]
    assert found, f"api imports {name}, which is no module of it"
    return found


@pytest.mark.parametrize("module", API_MODULES)
def test_the_service_leaves_numerics_to_the_library(module: str) -> None:
    for name in _imports(module, API):
        root = name.split(".")[0]
        assert root not in NUMERICS, f"{module} imports {root}"
        assert module in API_LIBRARIES.get(root, {module}), f"{module} imports {root}"


@pytest.mark.parametrize("module", MODULES)
def test_the_library_knows_nothing_of_the_service(module: str) -> None:
    everywhere = module != SERVICE_COMMANDS
    tree = ast.parse(_path(module).read_text())
    for name in _imported(tree, module, lazily=everywhere):
        assert name.split(".")[0] != "api", f"{module} imports {name}"


@pytest.mark.parametrize("module", API_MODULES)
def test_public_names_of_the_service_are_sorted_documented_and_few(module: str) -> None:
    _check_public_names(f"api.{module}")


@pytest.mark.parametrize(
    "package", sorted(API.rglob("*/__init__.py")), ids=lambda path: path.parent.name
)
def test_packages_of_the_service_offer_what_they_list(package: Path) -> None:
    name = ".".join(package.parent.relative_to(API.parent).parts)
    loaded = importlib.import_module(name)
    assert loaded.__doc__
    names = getattr(loaded, "__all__", [])
    assert list(names) == sorted(names, key=_as_ruff_sorts)
    assert all(getattr(loaded, offered) is not None for offered in names)


@pytest.mark.parametrize("module", API_MODULES)
def test_modules_of_the_service_stay_short(module: str) -> None:
    assert len(_path(module, API).read_text().splitlines()) <= 300
