"""Table of figures. A new figure is a function that draws it and an entry here.

Importing it is cheap: a figure's own module is loaded when the figure is drawn.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from syncplan.planning.plans import Plan
    from syncplan.plotting.canvas import Spec
    from syncplan.plotting.figure_style import FigureStyle
    from syncplan.reports.refinement_report import RefinementResult

IMAGE_FORMATS = ("png", "svg", "pdf")
"""Image formats that a figure can be drawn in."""

SubjectKind = Literal["plan", "run", "flight", "sweep", "losses", "design"]

SUBJECTS: Mapping[SubjectKind, str] = MappingProxyType(
    {
        "plan": "a plan",
        "run": "a validation or replay",
        "flight": "a flight",
        "sweep": "a sweep",
        "losses": "a what-if",
        "design": "a design",
    }
)
"""Kinds of subject that figures are drawn from, in words."""


@dataclass(frozen=True, slots=True)
class FigureInput:
    """Data that figures are drawn from.

    Attributes
    ----------
    of : kind of the subject
    subject : the plan, or the document of a run, a sweep, a what-if or a design
    refined : the record of the plan's refinement, if there was one
    after : a second plan to compare with
    style : size, text scale, theme
    """

    of: str
    subject: Any
    style: "FigureStyle"
    refined: "RefinementResult | None" = None
    after: "Plan | None" = None


def _subject_alone(given: FigureInput) -> tuple[Any, ...]:
    return (given.subject,)


def _subject_in_style(given: FigureInput) -> tuple[Any, ...]:
    return given.subject, given.style


_NO_SERIES = "the report has no figures over time (--series keeps them)"


@dataclass(frozen=True, slots=True)
class Figure:
    """Entry of the table of figures.

    Attributes
    ----------
    title, sentence : heading, and description in a sentence
    of : kind of its subject
    maker : module of this package, and the function in it that returns Plotly's plain values
    takes : function that returns the maker's arguments
    part : dotted key that a report must hold to have the figure; empty if every report has it
    there : further condition on a subject; None if there is none
    why_not : reason why a subject may lack it
    compares : whether it shows two plans; it is then the figure shown unless another is named
    of_errors : whether it needs known errors, which only recordings without truth lack
    """

    title: str
    sentence: str
    of: SubjectKind
    maker: str
    takes: Callable[[FigureInput], tuple[Any, ...]] = _subject_in_style
    part: str = ""
    there: Callable[[FigureInput], bool] | None = None
    why_not: str = ""
    compares: bool = False
    of_errors: bool = False

    def fits(self, given: FigureInput) -> bool:
        """Return whether a subject of the right kind has this figure."""
        if self.of_errors and not given.subject.has_errors:
            return False
        if self.part and not _part(given.subject, self.part):
            return False
        return self.there is None or self.there(given)

    def draw(self, given: FigureInput) -> "Spec":
        """Return the figure as Plotly's plain values, in the style given."""
        from syncplan.plotting.canvas import fitted
        from syncplan.plotting.figure_style import themed

        module, _, function = self.maker.partition(".")
        make = getattr(import_module(f"{__package__}.{module}"), function)
        return themed(fitted(make(*self.takes(given)), given.style), given.style.theme)


FIGURES: Mapping[str, Figure] = MappingProxyType(
    {
        "formation": Figure(
            "Formation",
            "Circles with their directions, vehicles at time 0, links by rank and certificate, "
            "landmarks; arrows show motions that no sighting can detect.",
            "plan",
            "formation_figures.formation_spec",
        ),
        "animation": Figure(
            "One period",
            "Where the vehicles are and who sees whom, through one period.",
            "plan",
            "formation_figures.animation_spec",
        ),
        "timeline": Figure(
            "Contacts",
            "When each vehicle sees which other vehicle or landmark, and what the union of these "
            "sightings connects as time goes on.",
            "plan",
            "contact_figures.timeline_spec",
        ),
        "spectrum": Figure(
            "Singular values",
            "Singular values of the windowed observability matrix; the rank rests on the gap.",
            "plan",
            "contact_figures.spectrum_spec",
            takes=_subject_alone,
        ),
        "prediction": Figure(
            "Predicted error",
            "The least RMS position error that any unbiased filter can reach, vehicle by vehicle.",
            "plan",
            "accuracy_figures.prediction_spec",
        ),
        "refinement": Figure(
            "Refinement",
            "Figures of merit of the plan before it was refined, and after.",
            "plan",
            "comparison_figure.refinement_spec",
            takes=lambda given: (given.refined, given.subject.scenario.name, given.style),
            there=lambda given: given.refined is not None,
            why_not="the plan was not refined",
        ),
        "comparison": Figure(
            "Before and after",
            "Circles and predicted errors of two plans of the same vehicles.",
            "plan",
            "comparison_figure.comparison_spec",
            takes=lambda given: (given.subject, given.after, given.style),
            there=lambda given: given.after is not None,
            why_not="there is no second plan (--compare)",
            compares=True,
        ),
        "accuracy": Figure(
            "Error found",
            "RMS position errors of the filter, beside the predicted ones where these are known.",
            "run",
            "accuracy_figures.accuracy_spec",
            of_errors=True,
            why_not="the recording has no truth, so errors are not known",
        ),
        "sigmas": Figure(
            "Sigmas",
            "The filter's own position sigmas, where a recording has no truth.",
            "run",
            "accuracy_figures.sigmas_spec",
            there=lambda given: not given.subject.has_errors,
            why_not="errors are known",
        ),
        "errors": Figure(
            "Errors over time",
            "Errors in x, y and heading with the filter's own 3-sigma band.",
            "run",
            "series_figures.errors_spec",
            part="series",
            why_not="the report has no errors over time (--series keeps them where the truth is "
            "known)",
        ),
        "estimates": Figure(
            "Estimates over time",
            "Estimated x and y of each robot with the filter's own 3-sigma band, where a recording "
            "has no truth.",
            "run",
            "series_figures.estimates_spec",
            part="estimates",
            why_not="the report has no estimates over time (--series keeps those of a recording "
            "without truth)",
        ),
        "states": Figure(
            "Further states over time",
            "RMS error of each filter state other than a pose, such as wind or a bias, beside "
            "the filter's own sigma and the predicted error.",
            "run",
            "series_figures.states_spec",
            part="series.errors",
            why_not="the report has no errors of further states over time (--series keeps those "
            "that filter.estimate names)",
        ),
        "consistency": Figure(
            "Consistency",
            "Whether the filter's errors are as large as it says: ANEES, NIS, 3-sigma coverage.",
            "run",
            "accuracy_figures.consistency_spec",
        ),
        "stress": Figure(
            "Stress",
            "By how much the error grows in worlds that are worse than the scenario states.",
            "run",
            "study_figures.stress_spec",
            takes=_subject_alone,
            part="stress",
            why_not="the report has no worse worlds (validate --stress adds them)",
        ),
        "tracks": Figure(
            "Tracks",
            "True and estimated paths of a trial over the planned circles, with the filter's own "
            "ellipses at moments over the run.",
            "flight",
            "flight_tracks_figure.flight_tracks_spec",
            part="series",
            why_not=_NO_SERIES,
        ),
        "tracking": Figure(
            "Errors in flight",
            "RMS distance from the plan and RMS error of the estimate over time, beside the bound "
            "along the path, the filter's own sigma and the plan's prediction.",
            "flight",
            "flight_figures.flight_errors_spec",
            part="series",
            why_not=_NO_SERIES,
        ),
        "phases": Figure(
            "Phase errors",
            "How far each vehicle is ahead of the plan, or behind it, over time, and how far it "
            "may be.",
            "flight",
            "flight_figures.flight_phases_spec",
            part="series",
            why_not=_NO_SERIES,
        ),
        "separation": Figure(
            "Least separation",
            "The share of trials in which any two vehicles come nearer than a distance, beside the "
            "separation asked for and the plan's own.",
            "flight",
            "flight_figures.flight_separation_spec",
            takes=_subject_alone,
        ),
        "meetings": Figure(
            "Meetings kept",
            "The share of planned meetings in which a sighting was made, link by link.",
            "flight",
            "flight_figures.flight_meetings_spec",
            takes=_subject_alone,
        ),
        "events": Figure(
            "What was lost",
            "What was lost or held, and when.",
            "flight",
            "flight_figures.flight_events_spec",
            takes=_subject_alone,
            part="events",
            why_not="nothing was lost (--lose) and no vehicle held (--hold)",
        ),
        "sweep": Figure(
            "Sweep",
            "Errors over the value that was varied.",
            "sweep",
            "study_figures.sweep_spec",
            takes=_subject_alone,
        ),
        "losses": Figure(
            "Losses",
            "The worst predicted error after each loss of a vehicle, sensor or landmark, and which "
            "losses end observability.",
            "losses",
            "study_figures.losses_spec",
            takes=_subject_alone,
        ),
        "front": Figure(
            "Front",
            "The worst error found for each number of vehicles and landmarks, the need, and the "
            "winner.",
            "design",
            "study_figures.front_spec",
            takes=_subject_alone,
        ),
    }
)
"""All figures by name, in the order in which they are shown."""


def always_there(of: SubjectKind) -> list[str]:
    """Return the names of the figures that every subject of a kind has, if its errors are known."""
    return [
        name
        for name, figure in FIGURES.items()
        if figure.of == of and not figure.part and figure.there is None
    ]


def _part(report: Any, path: str) -> Any:
    """Part of a report by its dotted key; None if the report lacks it."""
    for key in path.split("."):
        report = getattr(report, key, None)
    return report
