"""Covariances of positions over the last period of a plan, as a document."""

from typing import Annotated

from pydantic import Field

from syncplan.documents import Document
from syncplan.estimation.bounds import PositionCovariances
from syncplan.planning.plans import Plan

DIGITS = 4
"""Digits of a covariance."""

Covariance = Annotated[list[float], Field(min_length=3, max_length=3)]
"""(xx, xy, yy) in m^2."""


class PositionCovariancesDocument(Document):
    """Predicted covariances of positions, from the bound behind the predicted RMS errors."""

    time_s: list[float] = Field(
        description="Moments of the last period, since the start of the run; the last is its end",
        examples=[[268.6, 284.3, 300.0]],
    )
    vehicles: dict[str, list[Covariance]] = Field(
        description="Of each vehicle, its position's variance east, covariance and variance north "
        "at these moments, in m^2",
        examples=[{"v1": [[0.61, 0.08, 0.35], [0.58, 0.06, 0.36], [0.6, 0.07, 0.35]]}],
    )


def position_covariances_document(plan: Plan) -> PositionCovariancesDocument:
    """Return the document of a plan's covariances; raises NoSolutionError where it has none."""
    found = plan.position_covariances()
    names = plan.scenario.vehicle_names
    return PositionCovariancesDocument(
        time_s=[float(f"{time:.6g}") for time in found.times],
        vehicles={name: _rounded(found, k) for k, name in enumerate(names)},
    )


def _rounded(found: PositionCovariances, vehicle: int) -> list[Covariance]:
    def short(value: float) -> float:
        return float(f"{value:.{DIGITS}g}")

    own = found.values[:, vehicle]
    return [[short(one[0, 0]), short(one[0, 1]), short(one[1, 1])] for one in own]
