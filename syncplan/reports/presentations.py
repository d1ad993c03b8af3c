"""Results as documents and as data frames."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from syncplan.designs.designer import Design
from syncplan.errors import InputError
from syncplan.estimation.replay_results import Replay
from syncplan.landmarks.site_choice import SiteChoice
from syncplan.planning.plan_flights import Flight
from syncplan.planning.plans import Plan
from syncplan.planning.validation import Validation
from syncplan.planning.variations import StressTest, Sweep
from syncplan.reports.design_report import design_document
from syncplan.reports.flight_report import flight_document
from syncplan.reports.plan_report import plan_document
from syncplan.reports.replay_report import replay_document
from syncplan.reports.sites_report import sites_document
from syncplan.reports.validation_report import (
    stress_document,
    sweep_document,
    validation_document,
)
from syncplan.results.quantities import plain
from syncplan.results.result import Result
from syncplan.results.stories import Grid, Report, Row, Story, flat
from syncplan.scenario.specification import Scenario, per_vehicle


class _ScenarioTable(Report):
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


REPORTS: Mapping[type, Callable[[Any], Any]] = {
    Plan: plan_document,
    Validation: validation_document,
    StressTest: stress_document,
    Flight: flight_document,
    Replay: replay_document,
    SiteChoice: sites_document,
    Design: design_document,
    Sweep: lambda swept: sweep_document(
        swept.name, swept, [validation_document(row.validation) for row in swept]
    ),
    Scenario: _ScenarioTable,
}
"""Functions that make the document of each kind of result that is no document itself."""


def report_of(result: Any) -> Any:
    """Return the document of a result, which may be one itself."""
    if isinstance(result, Report):
        return result
    return next(REPORTS[kind](result) for kind in type(result).__mro__ if kind in REPORTS)


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
