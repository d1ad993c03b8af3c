"""Archive of flights: a part of a flight as bytes, an .npz file of plain arrays.

The arrays are named as the fields that hold them are: figures.kept_meetings. A field that holds
several is an array of their number, and each has its place in its name: estimates.branches.0.sums.
"""

import io
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, get_args, get_origin, get_type_hints
from zipfile import BadZipFile

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.flight.flight_results import FlightResult


def pack_flight(part: FlightResult) -> bytes:
    """Return a part as bytes that hold every bit of it."""
    buffer = io.BytesIO()
    arrays: dict[str, Any] = dict(_arrays(part, ""))
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def unpack_flight(data: bytes) -> FlightResult:
    """Return the part that `pack_flight` turned into bytes; raises InputError for other bytes.

    A field that parts did not have when they were packed takes its default.
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
    """The value of a type whose arrays have this name."""
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
