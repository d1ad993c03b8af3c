"""Whether what is to be seen can be: findings on links lost or easily lost, hidden landmarks."""

from collections.abc import Iterator

from syncplan.orbits.sight_lines import hidden_landmarks, hidden_paths
from syncplan.phrases import listed
from syncplan.planning.findings import MOST_NAMED, Cure, Finding
from syncplan.planning.judged_team import JudgedTeam

FRAGILE_SHARE = 0.01
"""Of a period: a link that a vehicle this late loses is fragile."""


def lost_links(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the listed links that never come into contact."""
    names = judged.scenario.vehicle_names
    cure = "a longer range, nearer circles, or other phases"
    if judged.team.obstacles:
        cure += "; where sight is blocked, circles with nothing between them"
    for item in judged.dropped_links:
        yield Finding(
            "link-lost",
            "warning",
            f"link {names[item.a]}-{names[item.b]} dropped: {item.reason}",
            (names[item.a], names[item.b]),
            Cure(cure),
        )


def landmarks_hidden(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield the landmarks that lie within an obstacle."""
    names = judged.scenario.landmark_names
    for landmark, obstacle in hidden_landmarks(judged.team).items():
        yield Finding(
            "landmark-hidden",
            "warning",
            f"{names[landmark]} lies within obstacles_m[{obstacle}], where nobody can see it",
            (names[landmark],),
            Cure("move the landmark to the obstacle's outline or off it, or correct the outline"),
        )


def vehicles_hidden(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield a finding for each obstacle within which vehicles fly all the way round."""
    hidden = hidden_paths(judged.team)
    for obstacle in sorted(set(hidden.values())):
        names = [
            judged.scenario.vehicle_names[k] for k, where in hidden.items() if where == obstacle
        ]
        yield Finding(
            "vehicle-hidden",
            "warning",
            f"the whole path of {listed(names, MOST_NAMED)} lies within obstacles_m[{obstacle}], "
            "where nobody sees or is seen",
            tuple(names),
            Cure(
                "leave out of obstacles_m what vehicles fly in; the border of the area is area_m, "
                "and walls round it are thin polygons"
            ),
        )


def fragile_links(judged: JudgedTeam) -> Iterator[Finding]:
    """Yield one finding on all links that a small delay of one vehicle loses."""
    names, rate = judged.scenario.vehicle_names, judged.orbits.rate
    limit = FRAGILE_SHARE * judged.orbits.period
    fragile = sorted(
        (item for item in judged.links if item.tolerance / rate < limit),
        key=lambda item: item.tolerance,
    )
    if not fragile:
        return
    each = [f"{names[item.a]}-{names[item.b]} by {item.tolerance / rate:.3g} s" for item in fragile]
    yield Finding(
        "link-fragile",
        "warning",
        f"a vehicle that is late loses {listed(each, MOST_NAMED)}; less than {limit:.3g} s, 1 % of "
        "a period, is little to keep to",
        tuple(dict.fromkeys(names[k] for item in fragile for k in (item.a, item.b))),
        Cure("a longer range, nearer circles, or refinement with a larger margin"),
    )
