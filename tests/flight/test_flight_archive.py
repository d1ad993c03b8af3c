"""A flight cut into parts, kept as bytes and joined, is the flight flown in one."""

import io
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest

from syncplan.errors import InputError
from syncplan.estimation.trials import pack
from syncplan.flight.flying import flight_run
from syncplan.guidance.flight_results import FlightResult, pack_flight, unpack_flight
from syncplan.planning.plan_flights import FlightRun
from syncplan.reports.flight_report import flight_document
from syncplan.runtime.files import as_text
from tests.flight.test_flying import OPTIONS, QUICK, TRIALS
from tests.tools.on_paper import plan
from tests.tools.scenarios import small


@pytest.fixture(scope="module")
def run() -> FlightRun:
    """A flight with all that a result can hold: states, batch solutions, losses and series."""
    made = plan(small(**QUICK), pilot=False)
    return flight_run(made, trials=TRIALS, with_series=True, **OPTIONS)


@pytest.fixture(scope="module")
def parts(run: FlightRun) -> list[FlightResult]:
    cuts = ((0, 16, 1), (16, 20, 3))
    return [run.part(first, count, threads=threads) for first, count, threads in cuts]


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """All that a result holds, with where it does."""
    if is_dataclass(value):
        for field in fields(value):
            yield from leaves(getattr(value, field.name), f"{name}.{field.name}")
    elif isinstance(value, tuple):
        for k, item in enumerate(value):
            yield from leaves(item, f"{name}.{k}")
    else:
        yield name, value


def test_a_flight_in_parts_on_any_threads_is_the_whole_to_the_byte(
    run: FlightRun, parts: list[FlightResult]
) -> None:
    whole = run.whole(threads=2)
    joined = run.concluded([unpack_flight(pack_flight(part)) for part in parts])
    reports = [as_text(flight_document(flight).as_json()) for flight in (whole, joined)]
    assert reports[0] == reports[1]
    again, wanted = dict(leaves(joined.result)), dict(leaves(whole.result))
    assert len(again) == len(wanted) > 40
    for name, value in wanted.items():
        assert np.asarray(again[name]).tobytes() == np.asarray(value).tobytes(), name


def test_every_bit_of_a_part_is_kept_and_its_type(parts: list[FlightResult]) -> None:
    part = parts[1]
    again = dict(leaves(unpack_flight(pack_flight(part))))
    given = dict(leaves(part))
    assert list(again) == list(given)
    assert any(np.isnan(value).any() for value in given.values())
    assert any(name.endswith("branches.0.sums") for name in given)
    for name, value in given.items():
        assert type(again[name]) is type(value), name
        before, after = np.asarray(value), np.asarray(again[name])
        assert (before.dtype, before.shape) == (after.dtype, after.shape), name
        assert before.tobytes() == after.tobytes(), name


@pytest.mark.parametrize("data", [b"", b"nothing", b"PK\x03\x04 an archive cut short"])
def test_bytes_that_are_no_part_are_refused(data: bytes) -> None:
    with pytest.raises(InputError, match="not a part of a flight"):
        unpack_flight(data)


def without(data: bytes, name: str) -> bytes:
    """An archive without one of its arrays."""
    with np.load(io.BytesIO(data)) as stored:
        arrays: dict[str, Any] = {key: value for key, value in stored.items() if key != name}
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def test_a_part_without_what_every_part_has_is_refused(parts: list[FlightResult]) -> None:
    with pytest.raises(InputError, match=r"not a part of a flight.*separations"):
        unpack_flight(without(pack_flight(parts[0]), "figures.separations"))


def test_what_parts_did_not_have_at_first_takes_its_default(parts: list[FlightResult]) -> None:
    older = unpack_flight(without(pack_flight(parts[0]), "estimates.states_covered"))
    assert older.estimates.states_covered.shape == (0, 0)


def test_parts_of_a_validation_are_no_parts_of_a_flight(parts: list[FlightResult]) -> None:
    with pytest.raises(InputError, match="not a part of a flight"):
        unpack_flight(pack(parts[0].estimates))
