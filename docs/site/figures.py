"""The figures of the pages: each its values, and in words what is to be seen, with its numbers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from docs.site import studies
from syncplan.orbits.circles import position
from syncplan.planning.plans import Plan
from syncplan.plotting.canvas import Spec, axis, fitted, layout, numbers
from syncplan.plotting.figure_style import BLUE, GREEN, ORANGE, PLAIN, VERMILLION
from syncplan.plotting.figures import specs_of
from syncplan.reports.validation_report import ValidationDocument

__all__ = ["DRAWN", "Drawn", "final_error", "sight_direction"]

SAMPLES = 181


@dataclass(frozen=True, slots=True)
class Drawn:
    """A figure and its text alternative."""

    spec: Spec
    words: str


def sight_direction(plan: Plan) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time in s, direction in degrees and length in m of v1's line of sight to v2.

    The direction is that from the line of centres, over one period.
    """
    time = np.linspace(0.0, plan.orbits.period, SAMPLES)
    where = position(plan.orbits, time)
    apart = where[:, 1] - where[:, 0]
    across = plan.orbits.centers[1] - plan.orbits.centers[0]
    turn = np.arctan2(apart[:, 1], apart[:, 0]) - np.arctan2(across[1], across[0])
    return time, np.degrees(turn), np.hypot(*apart.T)


def final_error(report: ValidationDocument) -> tuple[float, float]:
    """Return RMS error and the filter's own sigma of v1 in x, in m, at the end of the run."""
    assert report.series is not None
    first = report.series.vehicles[0]
    rms, sigma = np.array([first.rms_x_m[-1], first.sigma_x_m[-1]], dtype=float).tolist()
    return rms, sigma


def _formation(plan: Plan) -> Drawn:
    verdict = plan.observability
    lost = "; ".join(motion.description for motion in plan.unobservable)
    words = (
        f"{plan.scenario.name}: {plan.orbits.count} circles, rank {verdict.rank} of "
        f"{verdict.state_dim}. "
    )
    words += (
        f"Arrows show motions that no sighting can detect: {lost}."
        if lost
        else "No motion is lost."
    )
    return Drawn(specs_of(plan, ["formation"])["formation"], words)


def _of_plan(name: str, words: str, plan: Callable[[], Plan]) -> Drawn:
    return Drawn(specs_of(plan(), [name])[name], words)


def _comparison() -> Drawn:
    before, after = studies.alternating(), studies.refined()
    errors = [one.prediction.rms for one in (before, after)]
    worst = [float(np.max(rms)) for rms in errors if rms is not None]
    words = (
        f"Before and after refinement: rank {before.observability.rank} and "
        f"{after.observability.rank} of {after.observability.state_dim}, predicted error of the "
        f"worst vehicle {worst[0]:.2f} m and {worst[1]:.2f} m."
    )
    return Drawn(specs_of(before, ["comparison"], after=after)["comparison"], words)


def _accuracy() -> Drawn:
    report = studies.proven()
    found, predicted = report.overall.rms_second_half_m, report.overall.predicted_rms_m
    words = (
        f"Errors found by {report.trials} trials beside the bound, vehicle by vehicle: "
        f"{found:.2f} m over the team, predicted {predicted:.2f} m."
    )
    return Drawn(specs_of(report, ["accuracy"])["accuracy"], words)


def _lines_of_sight() -> Drawn:
    cases = (
        ("opposite senses, equal radii, exact: mirror motion", "solid", VERMILLION, 4.0,
         studies.pair("alternate", 20.0, 0.0)),
        ("opposite senses, one vehicle 0.2 rad late", "dash", BLUE, 2.0,
         studies.pair("alternate", 20.0, studies.DESYNC_RAD)),
        ("opposite senses, radii of 20 and 15 m", "dashdot", GREEN, 2.0,
         studies.pair("alternate", 15.0, 0.0)),
        ("same sense", "dot", ORANGE, 2.5, studies.pair("ccw", 20.0, 0.0)),
    )  # fmt: skip
    traces = []
    words = []
    for name, dash, color, width, plan in cases:
        time, turn, length = sight_direction(plan)
        rank = plan.links[0].rank
        traces.append(_line(f"{name} (rank {rank})", time, turn, color, dash, width))
        seen = np.where(length <= plan.scenario.sensors[0].range_m, turn, np.nan)
        mark = _line("within range", time, seen, color, "solid", width + 5.0)
        traces.append({**mark, "opacity": 0.35, "showlegend": False, "hoverinfo": "skip"})
        most = np.abs(turn).max()
        words.append(f"{name}: turns by up to {most:.1f} degrees, rank {rank}")
    drawn = layout(
        "Direction of the line of sight over one period",
        note="from the line of centres, 70 m apart; broad where the two see each other",
        inner=340,
        xaxis=axis("time, s"),
        yaxis=axis("direction, degrees"),
    )
    return Drawn(
        fitted({"data": traces, "layout": drawn}, PLAIN),
        f"Direction of the line of sight. {'. '.join(words)}.",
    )


def _optimism() -> Drawn:
    exact, cured = studies.flown(), studies.flown(studies.DESYNC_RAD)
    traces = []
    for report, name, colour in ((exact, "exact", VERMILLION), (cured, "0.2 rad off", BLUE)):
        assert report.series is not None
        first, time = report.series.vehicles[0], np.array(report.series.time_s)
        rms, sigma = (np.array(one, dtype=float) for one in (first.rms_x_m, first.sigma_x_m))
        traces.append(_line(f"{name}: RMS error", time, rms, colour, "solid", 3.0))
        traces.append(_line(f"{name}: the filter's own sigma", time, sigma, colour, "dash", 2.0))
    (wrong, claimed), (right, own) = final_error(exact), final_error(cured)
    drawn = layout(
        "Error of v1 along x, and what the filter says of it",
        note=f"{exact.trials} trials of the alternating grid, seed {exact.seed}",
        inner=320,
        xaxis=axis("time, s"),
        yaxis=axis("m", rangemode="tozero"),
    )
    words = (
        f"Phased exactly, v1's error along x reaches {wrong:.1f} m after {exact.duration_s:g} s "
        f"while the filter's own sigma says {claimed:.1f} m (ANEES {exact.anees.value:.2f}, "
        f"{exact.anees.verdict}). With phases 0.2 rad off the rule the error is {right:.1f} m and "
        f"the sigma {own:.1f} m (ANEES {cured.anees.value:.2f}, {cured.anees.verdict})."
    )
    return Drawn(fitted({"data": traces, "layout": drawn}, PLAIN), words)


def _line(
    name: str, x: np.ndarray, y: np.ndarray | list[float], color: str, dash: str, width: float
) -> Spec:
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": numbers(x, 2),
        "y": numbers(y, 3),
        "line": {"color": color, "dash": dash, "width": width},
    }


DRAWN: Mapping[str, Callable[[], Drawn]] = {
    "accuracy": _accuracy,
    "animation": lambda: _of_plan(
        "animation",
        "Six vehicles on circles, neighbours turning opposite ways, through one period; lines show "
        "who sees whom.",
        partial(studies.alternating, studies.DESYNC_RAD),
    ),
    "comparison": _comparison,
    "formation-cured": lambda: _formation(studies.alternating(studies.DESYNC_RAD)),
    "formation-degenerate": lambda: _formation(studies.alternating()),
    "formation-same": lambda: _formation(studies.same()),
    "lines-of-sight": _lines_of_sight,
    "optimism": _optimism,
    "spectrum": lambda: _of_plan(
        "spectrum",
        "Singular values of the degenerate grid: sixteen stand above the tolerance, two at "
        "rounding errors, with a gap of many powers of ten between them.",
        studies.alternating,
    ),
    "timeline": lambda: _of_plan(
        "timeline",
        "When each vehicle sees which other vehicle or landmark over a period, and what the union "
        "joins.",
        studies.same,
    ),
}
"""Every figure by the name that pages give."""
