"""The JSON contract of how a simulated world differs, and of what was to be expected there."""

from pydantic import Field, JsonValue

from syncplan.reports.document_base import DocumentPart


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
