"""Whether the team survives losses: findings on single points of failure."""

from collections.abc import Iterator, Sequence

from syncplan.orbits.sightings import Loss
from syncplan.phrases import listed
from syncplan.planning.findings import Cure, Finding
from syncplan.planning.judged_team import JudgedTeam
from syncplan.planning.lost_parts import names_of, phrase_of

MOST_NAMED = 8


def single_points_of_failure(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield what, lost alone, ends observability."""
    if judged.single_points is None:
        yield Finding(
            "single-point-of-failure",
            "note",
            f"not checked for {judged.team.count} vehicles which losses end observability; "
            "syncplan what-if finds them",
        )
        return
    if judged.single_points:
        names, landmarks = judged.scenario.vehicle_names, judged.scenario.landmark_names
        lost = [
            (one.vehicles + one.sensors + tuple(k for _, k in one.kinds), one.landmarks)
            for one in judged.single_points
        ]
        yield Finding(
            "single-point-of-failure",
            "note",
            _sentence(_phrases(judged, judged.single_points)),
            tuple(
                dict.fromkeys(
                    [names[k] for vehicles, _ in lost for k in vehicles]
                    + [landmarks[k] for _, places in lost for k in places]
                )
            ),
            Cure("another landmark in view, or further links; syncplan what-if says what is lost"),
        )


def _phrases(judged: JudgedTeam, losses: Sequence[Loss]) -> list[str]:
    """Losses in words, a vehicle and its sensor named once: vehicles, sensors, landmarks."""
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
    named = listed(phrases, MOST_NAMED)
    return f"losing {'any one of ' if len(phrases) > 1 else ''}{named} ends observability"
