"""Tasks that show plans and reports: previews, figures, losses, exports."""

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal, TypedDict

from api.job_kinds.job_table import JOB_KINDS
from api.limits import RequestLimits
from api.plan_texts import Syntax, loaded_body, loaded_plan
from syncplan.reports.job_contract import JobKindName

if TYPE_CHECKING:
    from syncplan.planning.planner import BoundChoice, Plan
    from syncplan.plotting.figure_style import Theme

__all__ = ["exported", "judged_losses", "plan_figure", "previewed", "ready", "report_figure"]


class _LeftOut(TypedDict):
    bound: "BoundChoice"
    margin_bound: bool
    pilot: bool
    single_points: bool


_QUICK: _LeftOut = {
    "bound": "never",
    "margin_bound": False,
    "pilot": False,
    "single_points": False,
}
"""What a plan is not asked for while somebody drags."""


def ready() -> None:
    """Load what the first preview would otherwise wait for."""
    import syncplan.plotting.figures  # noqa: F401


def previewed(
    body: bytes,
    syntax: Syntax,
    limits: RequestLimits,
    quick: bool,
    names: Sequence[str],
    theme: "Theme",
) -> str:
    """Return a plan as made_plan makes it with figures of it, as JSON; raises as that does.

    A `quick` one is the plan without what takes most of the time, which its findings name.
    """
    from syncplan.planning.plan_files import plan_of
    from syncplan.plotting.figure_style import FigureStyle
    from syncplan.plotting.figures import specs_of
    from syncplan.reports.plan_report import plan_document

    loaded = loaded_body(body, syntax, limits)
    made = plan_of(loaded, **_QUICK) if quick else plan_of(loaded)
    specs = specs_of(made, names, style=FigureStyle(theme=theme)) if names else {}
    return _compact({"plan": plan_document(made).as_json(), "figures": specs})


def plan_figure(text: str, name: str, theme: "Theme", parent_text: str | None) -> str:
    """Return a figure of a plan as JSON; raises InputError for one that it does not have.

    With its parent's text, the plan is shown beside its parent.
    """
    from syncplan.plotting.figure_style import FigureStyle
    from syncplan.plotting.figures import specs_of
    from syncplan.reports.refinement_report import RefinementResult

    style = FigureStyle(theme=theme)
    if parent_text is not None:
        specs = specs_of(_judged(parent_text), [name], style=style, after=_judged(text))
        return _compact(specs[name])
    record = json.loads(text).get("refinement")
    refined = None if record is None else RefinementResult.model_validate(record)
    return _compact(specs_of(_judged(text), [name], style=style, refined=refined)[name])


def report_figure(text: str, kind: JobKindName, name: str, theme: "Theme") -> str:
    """Return a figure of a job's report as JSON; raises InputError."""
    from syncplan.plotting.figure_style import FigureStyle
    from syncplan.plotting.figures import specs_of

    model = JOB_KINDS[kind].report
    assert model is not None
    report: Any = model.model_validate_json(text)
    return _compact(specs_of(report, [name], style=FigureStyle(theme=theme))[name])


def judged_losses(
    text: str, lose: Sequence[str], losses: Literal[1, 2], bound: "BoundChoice"
) -> str:
    """Return what losses do to a plan as JSON; raises InputError for a name it does not have."""
    from syncplan.planning.loss_study import what_if
    from syncplan.reports.loss_report import what_if_document
    from syncplan.runtime.files import as_text

    found = what_if(_judged(text), lose, losses=losses, bound=bound, threads=1)
    return as_text(what_if_document(found).as_json())


def exported(text: str, name: str, options: Mapping[str, Any]) -> tuple[bytes, tuple[str, ...]]:
    """Return the files of an export of a plan, zipped, and its notes; raises InputError."""
    from syncplan.exporting.formats import ExportOptions, as_archive, export

    made = export(_judged(text), name, ExportOptions(**options))
    return as_archive(made), made.notes


@lru_cache(maxsize=4)
def _judged(text: str) -> "Plan":
    from syncplan.planning.plan_files import plan_of

    return plan_of(loaded_plan(text))


def _compact(values: Any) -> str:
    return json.dumps(values, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
