"""Options of a pilot flight."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from syncplan.planning.share_test import MOST_FLIGHTS

if TYPE_CHECKING:
    from syncplan.guidance.flown_team import FlownTeam


@dataclass(frozen=True, slots=True)
class PilotOptions:
    """Options of a pilot flight.

    Attributes
    ----------
    most_flights : flights after which a share remains undecided
    threads : by default, all cores
    progress : called with the number of flights done and the number expected
    compile_kernels : called before flights with the team that flies, to compile kernels
    limited : whether teams whose flights take long stay on paper
    """

    most_flights: int = MOST_FLIGHTS
    threads: int | None = None
    progress: Callable[..., None] | None = None
    compile_kernels: "Callable[[FlownTeam], None] | None" = None
    limited: bool = True
