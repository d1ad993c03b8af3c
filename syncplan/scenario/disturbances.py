"""Disturbances of vehicles and their readings, and the errors that the filter estimates.

A random walk does not depend on the sample time: over a time t, the position integrated from speed
readings drifts by the random walk times sqrt(t). With a standard deviation of each reading, the
drift does depend on it: half the sample time gives twice as many readings to average.
"""

from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, get_args

from pydantic import BeforeValidator, Field, model_validator

from syncplan.scenario.filters import AUTO, FILTERS, FilterChoice
from syncplan.scenario.quantities import Many, Section, fault

Sigma = Annotated[float, Field(ge=0, le=1e3)]

ReadingsKind = Literal["commanded", "measured"]
"""Kind of the motion readings in flight."""

ESTIMABLE: Mapping[str, str] = MappingProxyType(
    {
        "wind": "wind.sigma_mps",
        "speed_scale": "motion.speed_scale_sigma",
        "turn_rate_bias": "motion.turn_rate_bias_sigma_rad_s",
        "bearing_bias": "sensor.bearing_bias_sigma_rad",
        "gusts": "wind.gust_sigma_mps",
        "bearing_walk": "sensor.bearing_walk.sigma_rad",
        "clock_offset": "motion.clock_offset_sigma_s",
    }
)
"""Errors that the filter can estimate as bias states, each with the key of its sigma.

Each also has a line in `syncplan.orbits.error_states.ERROR_STATES`. A new error that acts like an
existing one needs these two lines and the key in its section. One that shifts distances also needs
a part in `syncplan.refinement.smooth_bound`, which otherwise leaves it out.
"""

if TYPE_CHECKING:
    EstimableName = str
else:
    EstimableName = Literal[tuple(ESTIMABLE)]


def error_sigma(sections: Any, path: Sequence[str]) -> float:
    """Return the largest number at a path of keys, in a section or a list of them; 0 if none."""
    if isinstance(sections, list):
        return max(error_sigma(one, path) for one in sections)
    if sections is None or not path:
        return sections or 0.0
    return error_sigma(getattr(sections, path[0]), path[1:])


_Choice = Literal["auto", "all", "none"]


def _choice_or_names(value: Any) -> Any:
    """Check the value of `filter.estimate`: a choice or a list of names; raise its fault."""
    if isinstance(value, list):
        for k, name in enumerate(value):
            if name not in list(ESTIMABLE):
                raise fault(f"[{k}]", f"must be one of {', '.join(ESTIMABLE)}", name)
    elif value not in get_args(_Choice):
        names = f"a list of {', '.join(ESTIMABLE)}"
        raise fault("", f"must be {', '.join(get_args(_Choice))} or {names}", value)
    return value


WALKS = {
    "position_random_walk_m_sqrt_s": "speed_sigma_mps",
    "angle_random_walk_rad_sqrt_s": "turn_rate_sigma_rad_s",
}


class Motion(Section):
    """Errors of the motion readings: noise per sample or per root second, and constant errors."""

    speed_sigma_mps: Sigma | None = Field(
        default=0.1,
        description="Standard deviation of a speed reading, each sample anew",
        examples=[0.1],
    )
    turn_rate_sigma_rad_s: Sigma | None = Field(
        default=0.01,
        description="Standard deviation of a turn-rate reading, each sample anew",
        examples=[0.01],
    )
    position_random_walk_m_sqrt_s: Sigma | None = Field(
        default=None,
        description="Random walk of the place integrated from speed readings, in "
        "m per root second, instead of speed_sigma_mps: the same at any sample time",
        examples=[0.03],
    )
    angle_random_walk_rad_sqrt_s: Sigma | None = Field(
        default=None,
        description="Random walk of the heading integrated from turn rates, in "
        "rad per root second, instead of turn_rate_sigma_rad_s: the same at any sample time",
        examples=[0.003],
    )
    speed_scale_sigma: Annotated[float, Field(ge=0, le=1)] | None = Field(
        default=None,
        description="Standard deviation of the share by which a vehicle's speed readings are "
        "wrong, constant in a run, each vehicle its own; no such error if not given",
        examples=[0.02],
    )
    turn_rate_bias_sigma_rad_s: Sigma | None = Field(
        default=None,
        description="Standard deviation of the bias of a vehicle's turn-rate readings, constant "
        "in a run, each vehicle its own; no such error if not given",
        examples=[0.005],
    )

    clock_offset_sigma_s: Sigma | None = Field(
        default=None,
        description="Standard deviation of a vehicle's clock offset: a sighting was made this much "
        "later than its stamp, constant in a run, each vehicle its own; no such error if not given",
        examples=[0.05],
    )

    lag_s: Annotated[float, Field(ge=0, le=1e3)] | None = Field(
        default=None,
        description="In flight, time constant with which speed and turn rate follow commands; none "
        "if not given",
        examples=[0.5],
    )
    readings: ReadingsKind | None = Field(
        default=None,
        description="In flight, kind of motion readings: commanded, the response to commands, from "
        "which the motion differs by the noise; or measured, the motion plus the noise. commanded "
        "if not given",
        examples=["measured"],
    )

    @model_validator(mode="before")
    @classmethod
    def _walk_in_place_of_the_default(cls, keys: Any) -> Any:
        if not isinstance(keys, dict):
            return keys
        keys = dict(keys)
        for walk, sigma in WALKS.items():
            if keys.get(walk) is not None:
                keys.setdefault(sigma, None)
            elif sigma in keys and keys[sigma] is None:
                del keys[sigma]
        return keys

    @model_validator(mode="after")
    def _one_noise(self) -> Self:
        for walk, sigma in WALKS.items():
            if getattr(self, walk) is not None and getattr(self, sigma) is not None:
                raise fault(walk, f"can't be combined with {sigma}; give one of the two")
        return self

    def speed_sigma(self, sample_time: float) -> float:
        """Return the standard deviation in m/s of a speed reading taken every `sample_time` s."""
        return _of_reading(self.speed_sigma_mps, self.position_random_walk_m_sqrt_s, sample_time)

    def turn_rate_sigma(self, sample_time: float) -> float:
        """Return the standard deviation in rad/s of a turn rate taken every `sample_time` s."""
        return _of_reading(
            self.turn_rate_sigma_rad_s, self.angle_random_walk_rad_sqrt_s, sample_time
        )


def _of_reading(sigma: float | None, walk: float | None, sample_time: float) -> float:
    """`sigma`, or that of readings whose integral drifts by `walk` in a second."""
    return (walk or 0.0) / float(sample_time) ** 0.5 if sigma is None else sigma


class InitialSigma(Section):
    """Standard deviations of each vehicle's pose at time 0."""

    position_m: Annotated[float, Field(ge=1e-6, le=1e6)] = Field(
        default=5.0, description="Standard deviation of each coordinate", examples=[5.0]
    )
    heading_rad: Annotated[float, Field(ge=1e-6, le=100)] = Field(
        default=0.1, description="Standard deviation of the heading", examples=[0.1]
    )


class Wind(Section):
    """Wind or current: one common to all, constant in a run, and each vehicle's own gusts."""

    sigma_mps: Sigma = Field(
        default=0.0,
        description="Standard deviation of each component of the common, constant wind",
        examples=[1.0],
    )
    gust_sigma_mps: Sigma = Field(
        default=0.0,
        description="Standard deviation of each component of a vehicle's own gusts, a first-order "
        "Gauss-Markov process",
        examples=[0.2],
    )
    gust_time_s: Annotated[float, Field(ge=1e-3, le=1e6)] = Field(
        default=10.0,
        description="Time over which the correlation of gusts falls to 1/e",
        examples=[10.0],
    )


class Filter(Section):
    """The filter, and the errors that it has as states beside the poses."""

    kind: FilterChoice | None = Field(
        default=None,
        description="The filter: "
        + "; ".join(f"{name}, {one.phrase}" for name, one in FILTERS.items())
        + f". {AUTO}, the default, is the cheapest of ekf, second-order and robust that flies well",
        examples=["auto"],
    )

    estimate: Annotated[_Choice | Many[EstimableName], BeforeValidator(_choice_or_names)] = Field(
        default="auto",
        description="Errors that are states of the filter: auto and all, every one that has a "
        f"sigma; none; or a list of {', '.join(ESTIMABLE)}. What is "
        "not estimated disturbs the vehicles all the same",
        examples=["auto"],
    )

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        if isinstance(self.estimate, list) and len(set(self.estimate)) < len(self.estimate):
            raise fault("estimate", "names one error twice", self.estimate)
        return self


def check_estimated(wanted: Sequence[EstimableName] | str, sigmas: Collection[str]) -> None:
    """Raise the fault if the filter is to estimate an error without a sigma in the scenario."""
    for k, name in enumerate(wanted if not isinstance(wanted, str) else ()):
        if name not in sigmas:
            raise fault(
                f"filter.estimate[{k}]",
                f"{name} has no sigma; give {ESTIMABLE[name]}, or leave {name} out",
            )
