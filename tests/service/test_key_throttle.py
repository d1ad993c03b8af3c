"""Wrong keys: counted by address, forgiven with time, and no bar to a key that was right before."""

from unittest.mock import Mock

import pytest

from api.problems import KeysThrottled
from api.security import KeyThrottle, is_this_machine, network_of

HERE, ELSEWHERE = "192.0.2.7", "192.0.2.8"


def _guessed(throttle: KeyThrottle, times: int, address: str = HERE) -> None:
    for number in range(times):
        throttle.admit(address, f"guess-{number}")
        throttle.refused(address)


def test_so_many_wrong_keys_a_minute_and_no_more() -> None:
    clock = Mock(return_value=1000.0)
    throttle = KeyThrottle(6, clock)
    _guessed(throttle, 6)
    with pytest.raises(KeysThrottled) as caught:
        throttle.admit(HERE, "one more")
    assert caught.value.headers["Retry-After"] == "10"
    throttle.admit(ELSEWHERE, "one more")
    clock.return_value += 9.9
    with pytest.raises(KeysThrottled):
        throttle.admit(HERE, "one more")
    clock.return_value += 0.2
    _guessed(throttle, 1)
    with pytest.raises(KeysThrottled):
        throttle.admit(HERE, "one more")
    clock.return_value += 60.0
    _guessed(throttle, 6)


def test_a_key_that_was_right_there_goes_on_and_nowhere_else() -> None:
    throttle = KeyThrottle(2, Mock(return_value=1000.0))
    throttle.admit(HERE, "right")
    throttle.accepted(HERE, "right")
    _guessed(throttle, 2)
    _guessed(throttle, 2, ELSEWHERE)
    throttle.admit(HERE, "right")
    with pytest.raises(KeysThrottled):
        throttle.admit(ELSEWHERE, "right")
    with pytest.raises(KeysThrottled):
        throttle.admit(HERE, "other")


def test_a_site_is_one_address_however_many_it_has() -> None:
    throttle = KeyThrottle(2, Mock(return_value=1000.0))
    for last in range(2):
        _guessed(throttle, 1, f"2001:db8::{last}")
    with pytest.raises(KeysThrottled):
        throttle.admit("2001:db8::ffff", "guess")
    throttle.admit("2001:db8:0:1::1", "guess")


def test_what_is_kept_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("api.security._MOST_ADDRESSES", 10)
    monkeypatch.setattr("api.security._MOST_PROVEN", 10)
    throttle = KeyThrottle(2, Mock(return_value=1000.0))
    for number in range(100):
        throttle.refused(f"198.51.100.{number}")
        throttle.accepted(HERE, f"key-{number}")
    assert {len(one) for one in (throttle._forgiven_at, throttle._proven)} == {10}


@pytest.mark.parametrize(
    ("address", "network"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("::1", "::1"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("testclient", "testclient"),
    ],
)
def test_what_an_address_counts_as(address: str, network: str) -> None:
    assert network_of(address) == network


def test_loopback_in_both_families() -> None:
    assert all(map(is_this_machine, ["127.0.0.1", "127.200.0.1", "::1", "::ffff:127.0.0.1"]))
    assert not any(map(is_this_machine, ["128.0.0.1", "::2", "::ffff:192.0.2.7", "0.0.0.0"]))
