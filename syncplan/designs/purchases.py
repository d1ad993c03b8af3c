"""What could be bought: changes of a brief that may lower the error of its best formation."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from syncplan.designs.candidates import Cell
from syncplan.planning.plans import Plan
from syncplan.scenario.brief import MOST_VEHICLES, Brief
from syncplan.scenario.disturbances import WALKS


@dataclass(frozen=True, slots=True)
class Offer:
    """A change of a brief.

    Attributes
    ----------
    words : the change in words
    brief : with the change
    cell : the team of the changed brief
    cost : by the brief's costs; None where they state none
    """

    words: str
    brief: Brief
    cell: Cell
    cost: float | None = None


@dataclass(frozen=True, slots=True)
class Purchase:
    """What an offer brings to the best formation found, searched anew.

    Attributes
    ----------
    words, cost : of the offer
    plan : its formation, refined
    worst : m, predicted error of the worst vehicle, by the exact code
    met : whether it meets the need with its margin
    """

    words: str
    cost: float | None
    plan: Plan
    worst: float
    met: bool


def offers_for(brief: Brief, cell: Cell) -> list[Offer]:
    """Return the changes of a brief that may help its best team."""
    sensor, motion, sites, prefer = brief.sensor, brief.motion, brief.landmarks, brief.prefer
    sharper, further = sensor.bearing_sigma_rad / 2, 1.5 * sensor.range_m
    found = [
        Offer(
            f"bearing_sigma_rad {sharper:.3g} instead of {sensor.bearing_sigma_rad:.3g}",
            _with(brief, "sensor", bearing_sigma_rad=sharper),
            cell,
        ),
        Offer(
            f"range_m {further:.4g} instead of {sensor.range_m:.4g}",
            _with(brief, "sensor", range_m=further),
            cell,
            cell.vehicles * prefer.range_per_m * (further - sensor.range_m),
        ),
    ]
    for names in WALKS.items():
        name = next((one for one in names if getattr(motion, one)), None)
        if name is not None:
            value = getattr(motion, name)
            words = f"{name} {value / 2:.3g} instead of {value:.3g}"
            found.append(Offer(words, _with(brief, "motion", **{name: value / 2}), cell))
    if cell.vehicles < MOST_VEHICLES:
        larger = replace(cell, vehicles=cell.vehicles + 1)
        team = _with(brief, "team", max=max(brief.team.max, larger.vehicles))
        found.append(Offer("one more vehicle", team, larger, prefer.vehicle))
    listed = sites.candidates_m or ()
    if not sites.given and (not listed or cell.landmarks < len(listed)):
        more = replace(cell, landmarks=cell.landmarks + 1)
        another = _with(brief, "landmarks", max=max(sites.most, more.landmarks))
        found.append(Offer("one more landmark", another, more, prefer.landmark))
    return found


def _with(brief: Brief, section: str, **keys: Any) -> Brief:
    """The brief with keys of a section replaced."""
    values: Mapping[str, Any] = getattr(brief, section).model_dump(exclude_none=True)
    return brief.model_copy(update={section: {**values, **keys}})
