"""Connections as they are counted: in all, by address, and those in the reserve."""

import resource
from collections.abc import Iterator
from unittest.mock import Mock

import pytest

from api.connections import (
    LARGEST_RESERVE,
    ConnectionLimits,
    Connections,
    limits_of_connections,
    raise_limit,
)
from api.settings import load_settings


def _client(network: str = "here", engaged: bool = False) -> Mock:
    """A guest that notes whether it was turned away."""
    return Mock(network=network, engaged=engaged)


def _full(total: int = 3, per_address: int = 3) -> tuple[Connections, list[Mock]]:
    connections = Connections(ConnectionLimits(total=total, per_address=per_address))
    guests = [_client() for _ in range(min(total, per_address))]
    assert all(map(connections.enter, guests))
    return connections, guests


def test_beyond_all_there_is_the_reserve_until_somebody_leaves() -> None:
    connections, guests = _full(total=3)
    late = _client("elsewhere")
    assert not connections.enter(late)
    assert not connections.promote(late)
    connections.leave(guests[0])
    assert connections.promote(late)
    assert not connections.promote(late)
    assert connections.number == 3


def test_an_address_has_a_share_and_others_the_rest() -> None:
    connections, guests = _full(total=5, per_address=2)
    assert not connections.enter(_client())
    assert connections.enter(_client("elsewhere"))
    connections.leave(guests[0])
    assert connections.enter(_client())


def test_a_full_reserve_turns_away_the_oldest_that_waits() -> None:
    connections, _ = _full()
    busy, *silent = [_client("elsewhere", engaged=k == 0) for k in range(LARGEST_RESERVE)]
    assert not any(map(connections.enter, (busy, *silent)))
    assert not connections.enter(_client("elsewhere"))
    assert [guest.turn_away.call_count for guest in (busy, *silent[:2])] == [0, 1, 0]
    assert connections.number == 3 + LARGEST_RESERVE


def test_a_reserve_where_all_are_being_answered_turns_away_who_comes() -> None:
    connections, _ = _full()
    busy = [_client("elsewhere", engaged=True) for _ in range(LARGEST_RESERVE)]
    late = _client("elsewhere")
    assert not any(map(connections.enter, (*busy, late)))
    late.turn_away.assert_called()
    assert not any(guest.turn_away.called for guest in busy)
    assert connections.number == 3 + LARGEST_RESERVE


def test_whoever_leaves_twice_is_counted_once() -> None:
    connections, guests = _full()
    for guest in (*guests, *guests, _client()):
        connections.leave(guest)
    assert connections.number == 0


@pytest.mark.parametrize(
    ("descriptors", "given", "total", "per_address"),
    [
        (100_000, {}, 4096, 2048),
        (1024, {}, 704, 352),
        (200, {}, 32, 16),
        (1024, {"max_connections": 10}, 10, 5),
        (1024, {"max_connections_per_address": 10}, 704, 10),
        (1024, {"max_connections": 1}, 1, 1),
    ],
)
def test_limits_follow_from_settings_and_descriptors(
    descriptors: int, given: dict[str, int], total: int, per_address: int
) -> None:
    limits = limits_of_connections(load_settings(**given), descriptors)
    assert (limits.total, limits.per_address) == (total, per_address)


def test_times_of_connections_are_those_of_the_settings() -> None:
    names = ("head", "body", "answer", "idle")
    given = {f"{name}_timeout_s": float(k) for k, name in enumerate(names, 1)}
    limits = limits_of_connections(load_settings(**given), 1024)
    assert [getattr(limits, f"{name}_s") for name in names] == [1.0, 2.0, 3.0, 4.0]


@pytest.fixture
def restored() -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, before)


@pytest.mark.usefixtures("restored")
def test_the_limit_of_descriptors_is_raised_to_what_is_allowed() -> None:
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (512, hard))
    allowed = min(hard, 65_536) if hard != resource.RLIM_INFINITY else 65_536
    assert raise_limit() == allowed
    assert resource.getrlimit(resource.RLIMIT_NOFILE)[0] == allowed
    assert raise_limit() == allowed
