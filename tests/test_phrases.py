"""Words for places, those of a team told apart wherever it is, and for lengths."""

import pytest

from syncplan.phrases import Places, metres


@pytest.mark.parametrize(
    ("extent", "place", "words"),
    [
        (140.0, (19.1067, -5.9104123), "19.107, -5.9104"),
        (140.0, (159.1067, -1e-12), "159.11, 0"),
        (140.0, (465023.4412, 5249000.0), "465023.44, 5249000"),
        (0.5, (465000.12345, 2.0), "465000.12345, 2"),
        (5e5, (465023.4412, 5249000.0), "465023, 5249000"),
    ],
)
def test_places_have_decimals_by_the_extent_of_the_team(
    extent: float, place: tuple[float, float], words: str
) -> None:
    assert Places([(0.0, 0.0), (extent, 0.0)]).words(place) == words


def test_places_a_ten_thousandth_of_the_extent_apart_differ() -> None:
    for begin in (0.0, 1e3, 465e3, 5249e3):
        places = Places([(begin, 0.0), (begin + 70.0, 0.0)], [20.0])
        assert places.words((begin, 0.0)) != places.words((begin + 0.011, 0.0))


@pytest.mark.parametrize(
    ("length", "words"), [(2.41e-05, "0"), (-3e-15, "0"), (6e-05, "0.0001"), (19.966, "19.97")]
)
def test_a_residue_is_no_length(length: float, words: str) -> None:
    assert metres(length) == words


def test_one_vehicle_is_as_large_as_its_circle() -> None:
    assert Places([(465000.0, 0.0)], [20.0]).words((465012.3456, 0.0)) == "465012.346, 0"
