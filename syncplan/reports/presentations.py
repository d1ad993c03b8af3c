"""Results as documents, as rows of data frames and as tables in notebooks."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from html import escape
from typing import Any

from syncplan.designs.designer import Design
from syncplan.documents import Document
from syncplan.errors import InputError
from syncplan.estimation.replay_results import Replay
from syncplan.landmarks.site_choice import SiteChoice
from syncplan.planning.loss_study import WhatIf
from syncplan.planning.plan_flights import Flight
from syncplan.planning.plans import Plan
from syncplan.planning.validation import Validation
from syncplan.planning.variations import Sweep
from syncplan.reports.design_report import design_document
from syncplan.reports.flight_report import FlightDocument, PhaseError, flight_document
from syncplan.reports.loss_report import WhatIfDocument, what_if_document
from syncplan.reports.plan_report import PlanDocument, plan_document
from syncplan.reports.replay_report import replay_document
from syncplan.reports.sites_report import sites_document
from syncplan.reports.validation_report import sweep_document, validation_document
from syncplan.results import Result
from syncplan.scenario.specification import Scenario, per_vehicle

Row = dict[str, Any]

MOST_ROWS = 100
"""Largest number of rows that a notebook shows; the data frame holds all."""


@dataclass(frozen=True, slots=True)
class Presentation:
    """Conversions of a kind of result.

    Attributes
    ----------
    document : makes its document
    rows : makes rows of plain values from that document, one per vehicle, site, loss or value
    """

    document: Callable[[Any], Any]
    rows: Callable[[Any], list[Row]]


def document_of(result: Result) -> dict[str, Any]:
    """Return the document of a result as JSON values."""
    document = _presentation(result).document(result)
    if isinstance(document, Document):
        return document.as_json()
    return dict(document.model_dump(mode="json", exclude_none=True))


def frame_of(result: Result) -> Any:
    """Return the rows of a result as a pandas.DataFrame; raises InputError without pandas."""
    try:
        from pandas import DataFrame
    except ImportError:
        raise InputError(
            "needs pandas: pip install 'syncplan[dataframe]'", source="to_dataframe"
        ) from None
    return DataFrame(_rows(result))


def html_of(result: Result) -> str:
    """Return the rows of a result as an HTML table, below its summary and its plan's verdict."""
    rows = _rows(result)
    lines = [f"<p><b>{escape(repr(result)[1:-1])}</b></p>", *_verdict_lines(result)]
    if rows:
        head = "".join(f"<th>{escape(name)}</th>" for name in rows[0])
        body = "".join(
            f"<tr>{''.join(f'<td>{_cell(value)}</td>' for value in row.values())}</tr>"
            for row in rows[:MOST_ROWS]
        )
        lines.append(f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")
    if len(rows) > MOST_ROWS:
        lines.append(f"<p>{len(rows) - MOST_ROWS} more rows: to_dataframe() holds all</p>")
    return "\n".join(lines)


def _presentation(result: Result) -> Presentation:
    return next(PRESENTATIONS[kind] for kind in type(result).__mro__ if kind in PRESENTATIONS)


def _rows(result: Result) -> list[Row]:
    shown = _presentation(result)
    rows = shown.rows(shown.document(result))
    # the name of a row comes first
    return [{key: row[key] for key in sorted(row, key=lambda key: key != "name")} for row in rows]


def _verdict_lines(result: Result) -> list[str]:
    """HTML of the headline and the findings of a plan's verdict."""
    plan = result if isinstance(result, Plan) else getattr(result, "plan", None)
    if not isinstance(plan, Plan):
        return []
    verdict = plan.verdict
    found = "".join(
        f"<li>{escape(one.level)}: {escape(one.message)}</li>" for one in verdict.findings
    )
    return [f"<p>{escape(verdict.headline)}</p>", f"<ul>{found}</ul>" if found else ""]


def _cell(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else escape(str(value))


# --- rows -----------------------------------------------------------------------------------------


def _scenario_rows(scenario: Scenario) -> list[Row]:
    if not scenario.formation.placed:
        return [{"name": name} for name in scenario.vehicle_names]
    radii = per_vehicle(scenario.orbit.radius_m, scenario.size)
    return [
        {
            "name": name,
            **_flat({"center_m": center}),
            "radius_m": radius,
            **_flat(sensor.model_dump(exclude_none=True)),
        }
        for name, center, radius, sensor in zip(
            scenario.vehicle_names, scenario.centers, radii, scenario.sensors, strict=True
        )
    ]


def _plan_rows(document: PlanDocument) -> list[Row]:
    predicted, window = document.predicted_rms_m.vehicles, document.window_bound_m.vehicles
    flight = document.flight
    flown = {} if flight is None else {vehicle.name: vehicle.rms_m for vehicle in flight.vehicles}
    return [
        {
            **_flat(one.model_dump()),
            "predicted_rms_m": predicted.get(one.name),
            "window_bound_m": window.get(one.name),
            **({"flown_rms_m": flown.get(one.name)} if flown else {}),
        }
        for one in document.vehicles
    ]


def _flown_rows(document: FlightDocument) -> list[Row]:
    return [
        {
            **_flat(one.model_dump(exclude={"errors", "phase_error_s"})),
            **({} if one.phase_error_s is None else _named("phase", one.phase_error_s)),
            **({} if one.errors is None else _flat(one.errors.model_dump())),
        }
        for one in document.vehicles
    ]


def _named(stem: str, figures: PhaseError) -> Row:
    return {f"{stem}_{key}_s": value for key, value in figures.model_dump().items()}


def _loss_rows(document: WhatIfDocument) -> list[Row]:
    return [
        {
            "name": ", ".join(one.lost),
            **_flat(one.model_dump(exclude={"predicted_rms_m"})),
            "go": one.verdict.go,
        }
        for one in document.losses
    ]


def _sweep_rows(document: Any) -> list[Row]:
    return [
        {
            **_flat(row.model_dump(exclude={"validation"})),
            **_flat(row.validation.overall.model_dump()),
        }
        for row in document.rows
    ]


def _known(figures: Document) -> Row:
    """Values that are not null: a robot's depend on whether its recording has truth."""
    return {key: value for key, value in figures.as_json().items() if value is not None}


def _flat(values: Mapping[str, Any]) -> Row:
    """Plain values alone; a point [x, y] becomes two columns, `center_m` as `center_x_m`."""
    row: Row = {}
    for key, value in values.items():
        if isinstance(value, tuple) and len(value) == 2:
            stem, _, unit = key.rpartition("_")
            row.update({f"{stem}_x_{unit}": value[0], f"{stem}_y_{unit}": value[1]})
        elif not isinstance(value, list | tuple | dict):
            row[key] = value
    return row


PRESENTATIONS: Mapping[type, Presentation] = {
    Scenario: Presentation(lambda scenario: scenario, _scenario_rows),
    Plan: Presentation(plan_document, _plan_rows),
    Validation: Presentation(
        validation_document, lambda document: [_flat(one.model_dump()) for one in document.vehicles]
    ),
    Flight: Presentation(flight_document, _flown_rows),
    Replay: Presentation(
        replay_document, lambda document: [_flat(_known(one)) for one in document.robots]
    ),
    SiteChoice: Presentation(
        sites_document, lambda document: [_flat(one.model_dump()) for one in document.candidates]
    ),
    WhatIf: Presentation(what_if_document, _loss_rows),
    Design: Presentation(
        design_document, lambda document: [one.model_dump() for one in document.front]
    ),
    Sweep: Presentation(
        lambda swept: sweep_document(
            swept.name, swept, [validation_document(row.validation) for row in swept]
        ),
        _sweep_rows,
    ),
}
"""Presentation of each kind of result."""
