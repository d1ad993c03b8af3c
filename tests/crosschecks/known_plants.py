"""The plants that can be flown, each with the simple model beside it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from tests.crosschecks.jsbsim_planes import JsbsimPlanes
from tests.crosschecks.plants import MakePlant
from tests.crosschecks.responses import Step
from tests.crosschecks.rotorpy_team import hummingbirds
from tests.crosschecks.velocity_loop import ALIGNED, DROOPING, LoopGains


@dataclass(frozen=True, slots=True)
class Known:
    """A plant that can be flown.

    Attributes
    ----------
    make : returns what makes it
    courses : names of those that it flies
    lag : s, of the simple model beside it: about those found by `responses`
    circles : m/s, rad/s at which its steady errors are looked at
    steps : of commands, whose lags are looked for
    settled : s after which a circle is steady
    sample : s
    aligned : whether it is expected to agree with the model
    """

    make: Callable[[], MakePlant]
    courses: tuple[str, ...]
    lag: float
    circles: tuple[tuple[float, float], ...]
    steps: tuple[Step, ...]
    settled: float
    sample: float
    aligned: bool = True


def _multirotor(gains: LoopGains, lag: float, *, aligned: bool = True) -> Known:
    return Known(
        make=lambda: hummingbirds(gains),
        courses=("grid", "refined"),
        lag=lag,
        circles=((4.0, 0.2), (3.0, -0.2), (5.0, 0.3)),
        steps=(
            Step((4.0, 0.2), (4.5, 0.2), 20.0, 5.0),
            Step((4.0, 0.2), (3.5, 0.2), 20.0, 5.0),
            Step((4.0, 0.2), (4.0, 0.4), 20.0, 5.0),
            Step((4.0, 0.2), (4.0, 0.0), 20.0, 5.0),
        ),
        settled=30.0,
        sample=0.1,
        aligned=aligned,
    )


PLANTS: Mapping[str, Known] = MappingProxyType(
    {
        "multirotor": _multirotor(ALIGNED, 0.17),
        "drooping": _multirotor(DROOPING, 0.1, aligned=False),
        "plane": Known(
            make=lambda: JsbsimPlanes,
            courses=("planes",),
            lag=1.2,
            circles=((46.0, 0.0767), (42.0, -0.0767), (50.0, 0.09)),
            steps=(
                Step((46.0, 0.0767), (48.0, 0.0767), 80.0, 40.0),
                Step((46.0, 0.0767), (44.0, 0.0767), 80.0, 40.0),
                Step((46.0, 0.0767), (46.0, 0.11), 80.0, 20.0),
                Step((46.0, 0.0767), (46.0, 0.03), 80.0, 20.0),
            ),
            settled=80.0,
            sample=0.25,
        ),
    }
)
"""By name."""
