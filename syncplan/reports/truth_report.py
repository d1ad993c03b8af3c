"""How a simulated world differs from its scenario, and what that was expected to cost."""

from collections.abc import Sequence

import numpy as np
from pydantic import Field, JsonValue

from syncplan.arrays import Array
from syncplan.documents import DocumentPart
from syncplan.phrases import listed
from syncplan.planning.planner import Plan
from syncplan.scenario.truths import changed_keys


class TrueKey(DocumentPart):
    """A key of the scenario of which the simulated world differs."""

    key: str = Field(examples=["wind.gust_sigma_mps"])
    assumed: JsonValue = Field(
        description="The scenario's value, which plan, prediction and filter take for true; null "
        "where it gives none, a list where vehicles differ",
        examples=[0.2],
    )
    true: JsonValue = Field(description="The simulated world's value", examples=[0.6])


class ExpectedErrors(DocumentPart):
    """RMS position error to be expected, second half: per vehicle and over all."""

    overall: float
    vehicles: dict[str, float]


MOST_NAMED = 6
"""Keys that a note names."""


def keys_in_truth(plan: Plan) -> list[TrueKey] | None:
    """Return the keys of which a plan's world differs; None where it has no truth of its own."""
    scenario = plan.scenario
    if scenario.truth is None:
        return None
    found = changed_keys(scenario, scenario.in_truth, scenario.truth)
    return [TrueKey(key=one.key, assumed=one.assumed, true=one.true) for one in found]


def expected_in_truth(plan: Plan, expected: Array | None) -> ExpectedErrors | None:
    """Return the errors expected in a plan's world, (n,) m; None without a truth or figures."""
    if plan.scenario.truth is None or expected is None:
        return None
    return ExpectedErrors(
        overall=float(np.sqrt(np.mean(expected**2))),
        vehicles=dict(zip(plan.scenario.vehicle_names, expected.tolist(), strict=True)),
    )


def truth_note(
    keys: Sequence[TrueKey] | None,
    expected: ExpectedErrors | None,
    found: float,
    predicted: float | None,
) -> str | None:
    """Return in words how the world differs and what came of it, m; None without a truth."""
    if not keys:
        return None
    each = [f"{one.key} is {_words(one.true)}, not {_words(one.assumed)}" for one in keys]
    text = f"in the simulated world {listed(each, MOST_NAMED)}. Second-half RMS: {found:.3g} m"
    if expected is not None:
        text += f", {expected.overall:.3g} m expected"
    return text if predicted is None else f"{text}; the filter's own bound is {predicted:.3g} m"


def _words(value: object) -> str:
    if value is None:
        return "none"
    return f"{value:g}" if isinstance(value, float) else str(value)
