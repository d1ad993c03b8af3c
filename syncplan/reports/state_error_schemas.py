"""The JSON contract of errors of the filter's states that are no poses."""

from pydantic import Field

from syncplan.reports.document_base import DocumentPart


class StateErrorFigures(DocumentPart):
    """Errors of a state of the filter that is no pose, over all trials."""

    state: str = Field(description="What it is", examples=["wind x", "speed scale of v1"])
    unit: str = Field(description="Of the errors", examples=["m/s"])
    rms: float = Field(description="Over the samples after time 0")
    rms_second_half: float
    predicted_rms: float | None = Field(
        description="The bound, over the second half, for circles flown in still air: in a wind of "
        "a quarter of the speed, the wind itself is known half as well"
    )
    ratio: float | None = Field(description="Second-half RMS over predicted RMS")
    coverage: float = Field(description="Share of samples within 3 sigma; ideal 0.9973")


class StateErrorSeries(DocumentPart):
    """Errors over time of a state of the filter that is no pose, in its unit."""

    state: str = Field(examples=["wind x", "speed scale of v1"])
    unit: str = Field(examples=["m/s"])
    rms: list[float] = Field(description="Over the trials, at each sample of `time_s`")
    mean: list[float]
    sigma: list[float] = Field(description="The filter's own sigma")
    predicted: list[float] | None = Field(
        default=None, description="The bound; null where none is computed"
    )
