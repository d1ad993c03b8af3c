"""Findings on observability: rank, certificate, links, single points of failure."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from syncplan.observability.unobservable_modes import UnobservableMode, turning_cure
from syncplan.orbits.lost_parts import names_of, phrase_of
from syncplan.orbits.sight_lines import hidden_landmarks, hidden_paths
from syncplan.orbits.sightings import Loss
from syncplan.phrases import listed
from syncplan.planning.judged_team import MOST_NAMED, FindingCure, JudgedTeam, Level, Remark
from syncplan.planning.weakness import (
    LARGEST_CONDITION_NUMBER,
    WEAK_INDEX,
    weakness,
    windows_of,
)
from syncplan.scenario.specification import Scenario, per_vehicle

# --- rank and certificate -------------------------------------------------------------------------


_WITH_POSES: tuple[Level, str] = ("warning", "positions and headings rest")
_ERRORS_ALONE: tuple[Level, str] = ("note", "the filter rests")
"""Level and opening words of a finding on undetermined errors, with poses and without."""


def unobservable(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield a finding for each motion of the team that no sighting can detect."""
    names, rank = judged.scenario.vehicle_names, judged.observability
    window = f"rank {rank.rank} of {rank.state_dim} over {_window(judged.scenario)}"
    size = judged.sufficient_desync
    for mode in judged.unobservable:
        sized = replace(mode, desync=size) if mode.desync and size else mode
        yield Remark(
            "stop",
            f"no sighting can detect a {mode.description}; {window}",
            tuple(names[k] for k in mode.vehicles),
            cure=_cure_of(judged, sized),
        )


def weakly_observable(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that full rank determines some position too little for a filter."""
    verdict, predicted = judged.observability, judged.prediction.rms
    if not verdict.observable:
        return
    degenerate = verdict.condition_number > LARGEST_CONDITION_NUMBER
    window = judged.prediction.window
    index = np.zeros(judged.team.count)
    if predicted is not None:
        index = weakness(verdict, predicted, windows_of(judged.scenario))
    weak = np.flatnonzero(index > WEAK_INDEX)
    if not len(weak) and not degenerate:
        return
    names = judged.scenario.vehicle_names
    worst = int(np.argmax(index if len(weak) else window))
    message = f"one window determines {names[worst]} to {window[worst]:.4g} m at best"
    if predicted is not None:
        message += f", where {predicted[worst]:.3g} m are predicted"
    if len(weak):
        message += "; on exact circles, a filter that linearises at its estimates may miss that"
    if degenerate:
        message += f"; the condition number is {verdict.condition_number:.3g}"
    size, flown = judged.sufficient_desync, judged.flight is not None
    cure = "unequal radii, or refinement" if size is None else turning_cure(size)
    yield Remark(
        "note" if flown else "warning",
        f"observable, but weakly: {message}",
        tuple(names[k] for k in (weak if len(weak) else [worst])),
        cure=FindingCure(
            text=cure if flown else f"{cure}; flights show whether it matters",
            change=_desynchronised(judged, size),
        ),
    )


def needs_prior(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield a finding for each undetermined direction of errors that moves poses."""
    yield from _resting_on_priors(judged, poses=True)


def error_undetermined(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield a finding for each undetermined direction of errors that moves no pose."""
    verdict = judged.error_verdict
    if verdict is not None and verdict.extended is None:
        yield Remark(
            "note",
            f"not checked for {verdict.state_dim} states which errors one window determines: it "
            "takes long",
            cure="a smaller team of the same pattern, or fewer errors in filter.estimate; in "
            "Python syncplan.observability.error_modes.assess_extended has no limit",
        )
    yield from _resting_on_priors(judged, poses=False)


def _resting_on_priors(judged: JudgedTeam, *, poses: bool) -> Iterator[Remark]:
    """Yield a finding for each undetermined direction of errors that moves poses, or none."""
    verdict = judged.error_verdict
    if verdict is None or verdict.extended is None:
        return
    level, rests = _WITH_POSES if poses else _ERRORS_ALONE
    rank = f"rank {verdict.extended.rank} of {verdict.state_dim} with errors as states"
    for mode in verdict.modes:
        if mode.moves_poses == poses:
            yield Remark(
                level,
                f"{rests} on what is known of errors beforehand: no sighting can detect "
                f"{mode.description}; {rank}, over {_window(judged.scenario)}",
                tuple(judged.scenario.vehicle_names[k] for k in mode.vehicles),
                cure=mode.cure,
            )


def not_certified(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that the team is observable by rank, but without the certificate."""
    if judged.observability.observable and not judged.certificate.holds:
        names = judged.scenario.vehicle_names
        yield Remark(
            "note",
            "observable by rank, though the certificate (sufficient, not necessary) does not hold",
            tuple(names[k] for k in judged.certificate.lacking),
        )


def _window(scenario: Scenario) -> str:
    """Window of the judge in words, with the reason where the run cuts it."""
    if not scenario.run_cuts_window:
        return f"{scenario.window:.4g} s"
    return (
        f"the run of {scenario.window:.4g} s, shorter than the window of "
        f"{scenario.stated_window:.4g} s"
    )


def _cure_of(judged: JudgedTeam, mode: UnobservableMode) -> FindingCure:
    """Cure of a mode: a longer run, if that is known to do, or else the mode's own."""
    run = judged.sufficient_run
    if run is not None:
        text = f"a longer run: {run:.4g} s (duration_s) would do"
        return FindingCure(text=text, change={"duration_s": run})
    if judged.scenario.run_cuts_window:
        whole = f"a run of the whole window, {judged.scenario.stated_window:.4g} s (duration_s)"
        return FindingCure(text=f"{whole}; where that is not enough, {mode.cure}", change={})
    return FindingCure(text=mode.cure, change=_desynchronised(judged, mode.desync))


def _desynchronised(judged: JudgedTeam, size: float | None) -> dict[str, float]:
    """Change to a larger desynchronisation; none for one sense, which it turns as a whole."""
    now = per_vehicle(judged.scenario.orbit.desync_rad, judged.scenario.size)
    if not size or np.ptp(judged.orbits.senses) == 0.0 or max(map(abs, now)) >= size:
        return {}
    return {"orbit.desync_rad": size}


# --- links ----------------------------------------------------------------------------------------


FRAGILE_SHARE = 0.01
"""Share of a period: a link that tolerates less delay of a vehicle is fragile."""


def lost_links(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield a finding for each listed link that never comes into contact."""
    names = judged.scenario.vehicle_names
    cure = "a longer range, nearer circles, or other phases"
    if judged.team.obstacles:
        cure += "; where sight is blocked, circles with nothing between them"
    for item in judged.dropped_links:
        yield Remark(
            "warning",
            f"link {names[item.a]}-{names[item.b]} dropped: {item.reason}",
            (names[item.a], names[item.b]),
            cure=cure,
        )


def landmarks_hidden(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield a finding for each landmark that lies within an obstacle."""
    names = judged.scenario.landmark_names
    for landmark, obstacle in hidden_landmarks(judged.team).items():
        yield Remark(
            "warning",
            f"{names[landmark]} lies within obstacles_m[{obstacle}], where nobody can see it",
            (names[landmark],),
            cure="move the landmark to the obstacle's outline or off it, or correct the outline",
        )


def vehicles_hidden(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield a finding for each obstacle that contains whole paths of vehicles."""
    hidden = hidden_paths(judged.team)
    for obstacle in sorted(set(hidden.values())):
        names = [
            judged.scenario.vehicle_names[k] for k, where in hidden.items() if where == obstacle
        ]
        yield Remark(
            "warning",
            f"the whole path of {listed(names, MOST_NAMED)} lies within obstacles_m[{obstacle}], "
            "where nobody sees or is seen",
            tuple(names),
            cure="leave out of obstacles_m what vehicles fly in; the border of the area is area_m, "
            "and walls round it are thin polygons",
        )


def fragile_links(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield one finding on all links that are lost by a small delay of one vehicle."""
    names, rate = judged.scenario.vehicle_names, judged.orbits.rate
    limit = FRAGILE_SHARE * judged.orbits.period
    fragile = sorted(
        (item for item in judged.links if item.tolerance / rate < limit),
        key=lambda item: item.tolerance,
    )
    if not fragile:
        return
    each = [f"{names[item.a]}-{names[item.b]} by {item.tolerance / rate:.3g} s" for item in fragile]
    yield Remark(
        "warning",
        f"a vehicle that is late loses {listed(each, MOST_NAMED)}; less than {limit:.3g} s, 1 % of "
        "a period, is little to keep to",
        tuple(dict.fromkeys(names[k] for item in fragile for k in (item.a, item.b))),
        cure="a longer range, nearer circles, or refinement with a larger margin",
    )


# --- single points of failure ---------------------------------------------------------------------


MOST_POINTS = 8


def single_points_of_failure(judged: JudgedTeam) -> Iterator[Remark]:
    """Yield the finding that some single losses end observability."""
    if judged.single_points is None:
        yield Remark(
            "note",
            f"not checked for {judged.team.count} vehicles which losses end observability; "
            "what-if finds them",
        )
        return
    if judged.single_points:
        names, landmarks = judged.scenario.vehicle_names, judged.scenario.landmark_names
        lost = [
            (one.vehicles + one.sensors + tuple(k for _, k in one.kinds), one.landmarks)
            for one in judged.single_points
        ]
        yield Remark(
            "note",
            _sentence(_phrases(judged, judged.single_points)),
            tuple(
                dict.fromkeys(
                    [names[k] for vehicles, _ in lost for k in vehicles]
                    + [landmarks[k] for _, places in lost for k in places]
                )
            ),
            cure="another landmark in view, or further links; what-if says what is lost",
        )


def _phrases(judged: JudgedTeam, losses: Sequence[Loss]) -> list[str]:
    """Phrases for losses, a vehicle and its sensor in one: vehicles, sensors, landmarks."""
    names, gone = judged.scenario.vehicle_names, {k for one in losses for k in one.vehicles}
    blind = {k for one in losses for k in one.sensors}
    return [
        *(f"{names[k]}{' or its sensor' if k in blind else ''}" for k in sorted(gone)),
        *(f"the sensor of {names[k]}" for k in sorted(blind - gone)),
        *(
            phrase_of(name)
            for one in losses
            if one.kinds
            for name in names_of(one, judged.scenario)
        ),
        *(judged.scenario.landmark_names[k] for one in losses for k in one.landmarks),
    ]


def _sentence(phrases: list[str]) -> str:
    named = listed(phrases, MOST_POINTS)
    return f"losing {'any one of ' if len(phrases) > 1 else ''}{named} ends observability"
