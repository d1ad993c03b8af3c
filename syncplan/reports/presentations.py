"""Results as documents and as data frames."""

from collections.abc import Iterator, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Any

from syncplan.errors import InputError
from syncplan.results.quantities import plain
from syncplan.results.result import Result
from syncplan.results.stories import Grid, Report, Row, Story, flat
from syncplan.scenario.specification import Scenario, per_vehicle


class ScenarioTable(Report):
    """A scenario's vehicles as a table."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario

    def as_json(self) -> dict[str, Any]:
        """Return the scenario as JSON values."""
        return dict(self.scenario.model_dump(mode="json", exclude_none=True))

    def body(self) -> Story:
        """Yield the vehicles."""
        rows = list(self.frame_rows())
        cells = [
            [f"{v:.6g}" if isinstance(v, float) else plain(str(v)) for v in row.values()]
            for row in rows
        ]
        yield Grid("vehicles", list(rows[0]), cells)

    def frame_rows(self) -> Iterator[Row]:
        """Yield the vehicles as rows of a data frame."""
        scenario = self.scenario
        if not scenario.formation.placed:
            yield from ({"name": name} for name in scenario.vehicle_names)
            return
        radii = per_vehicle(scenario.orbit.radius_m, scenario.size)
        for name, center, radius, sensor in zip(
            scenario.vehicle_names, scenario.centers, radii, scenario.sensors, strict=True
        ):
            own = flat(sensor.model_dump(exclude_none=True))
            yield {"name": name, **flat({"center_m": center}), "radius_m": radius, **own}


REPORTS: Mapping[str, str] = MappingProxyType(
    {
        "Plan": "plan_report.plan_document",
        "Validation": "validation_report.validation_document",
        "StressTest": "validation_report.stress_document",
        "Sweep": "validation_report.sweep_document",
        "Flight": "flight_report.flight_document",
        "Replay": "replay_report.replay_document",
        "SiteChoice": "sites_report.sites_document",
        "Design": "design_report.design_document",
        "Scenario": "presentations.ScenarioTable",
    }
)
"""Modules of this package, and their functions, that make the document of each kind of result.

Each is loaded when such a result is shown, as most commands show one kind alone.
"""


def report_of(result: Any) -> Any:
    """Return the document of a result, which may be one itself."""
    if isinstance(result, Report):
        return result
    maker = next(
        REPORTS[kind.__name__] for kind in type(result).__mro__ if kind.__name__ in REPORTS
    )
    module, _, function = maker.partition(".")
    return getattr(import_module(f"{__package__}.{module}"), function)(result)


def document_of(result: Result) -> dict[str, Any]:
    """Return the document of a result as JSON values."""
    return dict(report_of(result).as_json())


def frame_of(result: Result) -> Any:
    """Return the rows of a result as a pandas.DataFrame; raises InputError without pandas."""
    try:
        from pandas import DataFrame
    except ImportError:
        raise InputError(
            "needs pandas: pip install 'syncplan[dataframe]'", source="to_dataframe"
        ) from None
    # the name of a row comes first
    return DataFrame(
        [
            {key: row[key] for key in sorted(row, key=lambda key: key != "name")}
            for row in report_of(result).frame_rows()
        ]
    )
