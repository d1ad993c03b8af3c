"""Terms of the field and of this library, each explained in a sentence or two.

Documentation and web page show the same sentences.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Term:
    """What a term means.

    Attributes
    ----------
    meaning : one or two sentences
    forms : further words for it, as they stand in headings and labels
    """

    meaning: str
    forms: tuple[str, ...] = ()


TERMS: Mapping[str, Term] = MappingProxyType(
    {
        "rank": Term(
            "Number of combinations of the team's unknowns, x, y and heading of each vehicle, that "
            "its sightings determine. At three for each vehicle, the team is observable."
        ),
        "observable": Term(
            "Property of a team whose sightings determine every position and heading."
        ),
        "unobservable motion": Term(
            "Change of positions and headings that changes no sighting, so that no sighting can "
            "detect it."
        ),
        "certificate": Term(
            "Proof of full rank from the links alone. It holds if every group of vehicles that is "
            "joined by links of rank 3 has links of rank 2 to two landmarks. Some teams are "
            "observable without it."
        ),
        "connectivity period": Term(
            "Shortest time whose sightings satisfy the certificate, no matter when it begins."
        ),
        "predicted RMS error": Term(
            "Bound on the root mean square of the position error over the second half of the run: "
            "on the planned circles, no unbiased filter has a smaller one.",
            forms=("predicted error",),
        ),
        "window bound": Term(
            "Least error of a vehicle's position by the sightings of one window alone, without "
            "what was known before."
        ),
        "polish": Term(
            "Local search for phases. It starts from those of a coarse one, such as a relaxation."
        ),
        "unlisted": Term(
            "Meeting of vehicles that formation.links does not list together; its sightings count, "
            "too."
        ),
        "least separation": Term(
            "Shortest distance between two vehicles at any time; in a scenario, the shortest that "
            "is allowed."
        ),
        "desynchronisation": Term(
            "Offset of each vehicle's phase from the exact rule. It lets lines of sight turn, "
            "which makes distances along them observable.",
            forms=("desynchronise",),
        ),
        "boresight": Term(
            "Middle of the field of view, as an angle from the vehicle's heading, "
            "counter-clockwise."
        ),
        "phase tolerance": Term("How far a phase may be off before a meeting is lost."),
        "ANEES": Term(
            "Average squared error of a filter in units of its own covariance, divided by the "
            "number of unknowns: 1 for a consistent filter, more for one that claims too much."
        ),
    }
)
"""Every term by its name."""
