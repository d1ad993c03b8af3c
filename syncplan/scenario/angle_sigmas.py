"""Standard deviations of angles that a scenario states, wherever they stand in its sections.

A field is one if its name ends with the unit rad and its dotted key names a sigma, so a field added
to a section counts here as well. Rates and random walks have other units.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from syncplan.scenario.quantities import Section


@dataclass(frozen=True, slots=True)
class AngleSigma:
    """A stated standard deviation of an angle.

    Attributes
    ----------
    key : dotted name, such as sensor.bearing_sigma_rad
    vehicle : index of the vehicle that it is stated for; None if stated for all
    value : rad
    """

    key: str
    vehicle: int | None
    value: float


def angle_sigmas(
    section: Section, prefix: str = "", vehicle: int | None = None
) -> Iterator[AngleSigma]:
    """Yield the standard deviations of angles in a section and those within it, in order.

    `prefix` is that of the section's keys, `vehicle` the index of the vehicle that it belongs to.
    """
    for name in type(section).model_fields:
        key, value = prefix + name, getattr(section, name)
        entries = enumerate(value) if isinstance(value, list) else [(vehicle, value)]
        for k, entry in entries:
            if isinstance(entry, Section):
                yield from angle_sigmas(entry, f"{key}.", k)
            elif isinstance(entry, float) and _is_angle_sigma(key):
                yield AngleSigma(key, k, entry)


def _is_angle_sigma(key: str) -> bool:
    return key.endswith("_rad") and "sigma" in key
