"""The tables that the page reads: figures, formats, objectives, keys, kinds and states of jobs."""

import json

from api.job_kinds.job_table import JOB_KINDS
from syncplan.exporting.format_table import AUTOPILOTS, FORMATS
from syncplan.flight.flight_options import GUIDANCES
from syncplan.plotting.figure_table import FIGURES, always_there
from syncplan.reports.job_contract import STATES, has_ended
from syncplan.scenario.dotted_keys import ALTERNATIVES, numeric_keys
from syncplan.scenario.objectives import OBJECTIVES


def tables_script() -> str:
    """Return the tables as JavaScript: names and words, in the order of the page."""
    pilots = {
        f"autopilot={name}&vehicle={vehicle}": title
        for name, autopilot in AUTOPILOTS.items()
        for vehicle, title in autopilot.titles.items()
    }
    of_plans = [kind for kind in JOB_KINDS.values() if kind.operation.about == "plan"]
    drawn = {"plan", *(kind.figures for kind in of_plans)}
    # what compares two plans is what their reader looks at first
    figures = sorted(
        (name for name, figure in FIGURES.items() if figure.of in drawn),
        key=lambda name: (name not in always_there("plan"), not FIGURES[name].compares),
    )
    tables = {
        "FIGURES": {name: FIGURES[name].title for name in figures},
        "PLAN_FIGURES": always_there("plan"),
        "FORMATS": {name: one.title for name, one in FORMATS.items()},
        "MISSIONS": [name for name, one in FORMATS.items() if one.mission],
        "PILOTS": pilots,
        "GUIDANCES": {name: one.sentence for name, one in GUIDANCES.items()},
        "OBJECTIVES": {name: one.title for name, one in OBJECTIVES.items()},
        "MEANINGS": {key: one.meaning for key, one in numeric_keys().items()},
        "ALTERNATIVES": ALTERNATIVES,
        "JOB_KINDS": {
            name: {
                "title": kind.title.capitalize(),
                "collection": kind.plural,
                "unit": kind.unit,
                "reports": kind.report is not None,
                # each with the part of the report that it needs
                "figures": {
                    figure: one.part
                    for figure, one in FIGURES.items()
                    if one.of == kind.figures and one.there is None
                },
            }
            for name, kind in JOB_KINDS.items()
        },
        "ENDED": [state for state in STATES if has_ended(state)],
    }
    lines = [f"export const {name} = {json.dumps(table)};" for name, table in tables.items()]
    return "\n".join(lines) + "\n"
