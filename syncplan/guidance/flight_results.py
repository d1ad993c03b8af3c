"""Results of flights: errors of estimates, and adherence to the plan; parts join exactly.

Sums over trials follow the binary tree of `syncplan.estimation.trials`.

An archive is a part of a flight as bytes, an .npz file of plain arrays named after their fields:
figures.kept_meetings. A tuple is stored as an array of its length, and each item has its index in
its name: estimates.branches.0.sums.
"""

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, get_args, get_origin, get_type_hints
from zipfile import BadZipFile

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.errors import InputError
from syncplan.estimation.trials import Branch, MonteCarloResult, joined, merge
from syncplan.guidance.flight_records import Track


@dataclass(frozen=True, slots=True)
class FlightFigures:
    """Adherence of trials to their plan, for n vehicles, p planned pairs and h holds.

    Attributes
    ----------
    planned_meetings : (p,) number of each pair's meetings in a trial
    tracking_squares : (trials, n) m^2, mean square of the distance from the planned place over the
        second half; NaN for a vehicle that is gone by then, here and below
    phase_squares, worst_phases : (trials, n) s^2, s, mean square and largest of the time
        ahead of or behind the plan, second half
    bound_squares : (trials, n) m^2, mean of the bound's variance along the path, second half
    state_bound_squares : (trials, e) the same for the filter's bias states, in their units
    separations : (trials,) m, least distance of any two vehicles
    nearest : (trials, 2) these two
    nearest_times : (trials,) s, time of that approach
    kept_meetings : (trials, p)
    longest_unseen : (trials, n) s, longest time without a sighting of or by a vehicle
    slowest, fastest : (trials, n) m/s, of the speeds commanded in the second half
    saturated, sought : (trials, n) share of samples, see Flown
    refused : (trials, n) share of decisions whose program was not solved
    sightings : (trials,) number of sightings made
    settled : (trials, h) s, from the end of each hold until the vehicle regains its phase; NaN
        where it never does
    """

    planned_meetings: Index
    tracking_squares: Array
    phase_squares: Array
    worst_phases: Array
    bound_squares: Array
    state_bound_squares: Array
    separations: Array
    nearest: Index
    nearest_times: Array
    kept_meetings: Array
    longest_unseen: Array
    slowest: Array
    fastest: Array
    saturated: Array
    sought: Array
    refused: Array
    sightings: Index
    settled: Array


@dataclass(frozen=True, slots=True)
class FlightResult:
    """Trials of a flight, in order.

    Attributes
    ----------
    estimates : errors of estimates against the truth flown; its series are not kept
    figures : adherence to the plan
    branches : sums over trials (k, n, 5) of a FlightSeries; empty unless requested
    tracks : of the first trials; empty unless requested
    """

    estimates: MonteCarloResult
    figures: FlightFigures
    branches: tuple[Branch, ...] = ()
    tracks: tuple[Track, ...] = ()

    @property
    def trials(self) -> int:
        """Number of trials."""
        return self.estimates.trials


SHARED = ("planned_meetings",)
"""Figures that all trials have in common."""


def joined_figures(parts: Sequence[FlightFigures]) -> FlightFigures:
    """Return the figures of all trials of consecutive parts."""
    values = {}
    for one in fields(FlightFigures):
        each = [getattr(part, one.name) for part in parts]
        values[one.name] = each[0] if one.name in SHARED else np.concatenate(each)
    return FlightFigures(**values)


def joined_flights(parts: Sequence[FlightResult]) -> FlightResult:
    """Return one result from consecutive parts of a flight, with the bytes of an undivided one.

    Raises InputError as syncplan.estimation.trials.merge does.
    """
    return FlightResult(
        merge([part.estimates for part in parts]),
        joined_figures([part.figures for part in parts]),
        joined([branch for part in parts for branch in part.branches]),
        tuple(track for part in parts for track in part.tracks),
    )


def first_flights(result: FlightResult, count: int) -> FlightResult:
    """Return the first trials of a flight, without series and tracks."""

    def first(values: Any) -> dict[str, Any]:
        each = {part.name: getattr(values, part.name) for part in fields(values)}
        return {
            name: value[:count]
            for name, value in each.items()
            if isinstance(value, np.ndarray) and name not in SHARED
        }

    estimates = replace(result.estimates, branches=(), **first(result.estimates))
    return FlightResult(estimates, replace(result.figures, **first(result.figures)))


# --- archives -------------------------------------------------------------------------------------


def pack_flight(part: FlightResult) -> bytes:
    """Return a part as bytes, without loss."""
    buffer = io.BytesIO()
    arrays: dict[str, Any] = dict(_arrays(part, ""))
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def unpack_flight(data: bytes) -> FlightResult:
    """Return the part that `pack_flight` turned into bytes; raises InputError for other bytes.

    Fields that the bytes do not contain take their defaults.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            part: FlightResult = _value(dict(stored), FlightResult, "")
    except (OSError, EOFError, BadZipFile, ValueError, TypeError, KeyError) as error:
        raise InputError(f"not a part of a flight: {error}", key="parts") from None
    return part


def _arrays(value: Any, name: str) -> Iterator[tuple[str, Array]]:
    """All arrays of a value, with their names."""
    if is_dataclass(value):
        for one in fields(value):
            yield from _arrays(getattr(value, one.name), _below(name, one.name))
        return
    if isinstance(value, tuple):
        yield name, np.asarray(len(value))
        for k, item in enumerate(value):
            yield from _arrays(item, _below(name, str(k)))
        return
    yield name, np.asarray(value)


def _value(stored: Mapping[str, Array], kind: Any, name: str) -> Any:
    """Value of a type from the arrays of this name."""
    if is_dataclass(kind):
        types, values = get_type_hints(kind), {}
        for one in fields(kind):
            place = _below(name, one.name)
            if _is_there(stored, place):
                values[one.name] = _value(stored, types[one.name], place)
        make: Any = kind
        return make(**values)
    if get_origin(kind) is tuple:
        item = get_args(kind)[0]
        return tuple(_value(stored, item, _below(name, str(k))) for k in range(int(stored[name])))
    found = stored[name]
    return found.item() if found.ndim == 0 else found


def _is_there(stored: Mapping[str, Array], name: str) -> bool:
    return name in stored or any(one.startswith(f"{name}.") for one in stored)


def _below(name: str, part: str) -> str:
    return f"{name}.{part}" if name else part
