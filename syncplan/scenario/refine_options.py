"""Options of refinement (what may vary, how far, for which objective) and limits of vehicles."""

from typing import Annotated, Literal, Self

from pydantic import Field, Strict, model_validator

from syncplan.scenario.chunked_validation import Many
from syncplan.scenario.objectives import (
    OBJECTIVES,
    PREDICTED_UP_TO,
    ObjectiveName,
    default_objective,
)
from syncplan.scenario.quantities import Length, Section, fault

DEFAULT_BOX_M = 5.0
"""How far a centre may move each way where neither a box nor an area is given."""

Variable = Literal["phases", "centers", "radii"]
Bounds = Annotated[tuple[Length, Length], Strict(False)]
Speed = Annotated[float, Field(ge=1e-9, le=1e6)]
Speeds = Annotated[tuple[Speed, Speed], Strict(False)]


def _described_objectives() -> str:
    """What can be improved, each in words, and what is if nothing else is named."""
    each = "; ".join(f"{one.name}, {one.sentence}" for one in OBJECTIVES.values())
    small, large = default_objective(PREDICTED_UP_TO), default_objective(PREDICTED_UP_TO + 1)
    return (
        f"What to improve: {each}. If not given, {small.name} for teams of up to "
        f"{PREDICTED_UP_TO} and {large.name} for larger ones. Only predicted errors count what the "
        "filter estimates beside the poses"
    )


class Limits(Section):
    """What the vehicles can fly or drive."""

    speed_mps: Speeds | None = Field(
        default=None, description="Least and largest speed along the circle", examples=[[3.0, 6.0]]
    )
    turn_rate_rad_s: Annotated[float, Field(gt=0, le=1e4)] | None = Field(
        default=None, description="Largest turn rate", examples=[0.5]
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        _check_order("speed_mps", self.speed_mps)
        return self


class RefineOptions(Section):
    """How a plan is refined: variables, limits, objective, effort."""

    vary: Many[Variable] = Field(
        default=["phases", "centers"],
        description="What may change: phases, centers, radii",
        examples=[["phases", "centers"]],
        json_schema_extra={"minItems": 1, "uniqueItems": True},
    )
    center_box_m: Annotated[float, Field(gt=0, le=1e7)] | None = Field(
        default=None,
        description="How far each centre may move along x and along y; "
        f"{DEFAULT_BOX_M:g} if neither this nor area_m is given",
        examples=[5.0],
    )
    radius_m: Bounds | None = Field(
        default=None, description="Least and largest radius", examples=[[15.0, 25.0]]
    )
    objective: ObjectiveName | None = Field(
        default=None,
        description=_described_objectives(),
        examples=["predicted_rms"],
    )
    margin_m: Annotated[float, Field(ge=0, le=1e7)] | None = Field(
        default=None,
        description="By how much meetings stay within range; a fiftieth of the range if not given",
        examples=[1.0],
    )
    time_limit_s: Annotated[float, Field(gt=0, le=1e6)] = Field(
        default=60.0, description="Wall time after which the best plan so far is taken"
    )
    starts: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=4,
        description="Starting points: the plan, the rules desynchronised, then random ones",
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(
        default=0, description="Seed of the starting points"
    )

    @model_validator(mode="after")
    def _agreeing(self) -> Self:
        if not self.vary:
            raise fault("vary", "is empty; name at least one of phases, centers, radii")
        if len(set(self.vary)) < len(self.vary):
            raise fault("vary", "names one value twice", self.vary)
        _check_order("radius_m", self.radius_m)
        if self.radius_m is not None and "radii" not in self.vary:
            raise fault("radius_m", "does nothing unless vary names radii")
        if self.radius_m is None and "radii" in self.vary:
            raise fault("radius_m", "is missing: vary names radii; give [least, largest]")
        if self.center_box_m is not None and "centers" not in self.vary:
            raise fault("center_box_m", "does nothing unless vary names centers")
        return self


def _check_order(key: str, limits: tuple[float, float] | None) -> None:
    if limits is not None and limits[0] > limits[1]:
        raise fault(key, "the least is larger than the largest", list(limits))
