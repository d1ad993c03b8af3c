"""Scenarios: what is accepted means what it says, what is not is refused in one clear line."""

import json
import math
from pathlib import Path
from typing import Any

import jsonschema_rs
import numpy as np
import pytest

from syncplan.errors import InputError
from syncplan.scenario.loading import load_scenario, parse_values, scenario_from
from syncplan.scenario.models import MAX_VEHICLES
from syncplan.scenario.specification import Scenario
from tests.tools.scenarios import BAD_FILES, FILES, document, small

REMEDIES = {
    "estimated-without-sigma": ("filter.estimate[0]", "give wind.sigma_mps"),
    "interval-not-a-multiple": ("sensor.interval_s", "multiple of sample_time_s, 0.1 s"),
    "misspelt-key": ("sensr", "did you mean sensor"),
    "nan-rate": ("orbit.angular_rate_rad_s", "finite"),
    "negative-radius": ("orbit.radius_m", "greater than 0"),
    "not-yaml": ("", "line"),
    "opposite-on-one-circle": ("orbit.direction", "another centre"),
    "out-of-reach": ("formation.links[0]", "raise range_m"),
    "rate-and-speed-disagree": ("orbit.speed_mps", "one of the two"),
    "unknown-vehicle": ("formation.links[0]", "vehicles are v1, v2"),
    "walk-and-sigma": ("motion.position_random_walk_m_sqrt_s", "give one of the two"),
}


def _refused(values: dict[str, Any]) -> InputError:
    with pytest.raises(InputError) as caught:
        scenario_from(values, source="test")
    assert "\n" not in str(caught.value)
    return caught.value


@pytest.mark.parametrize("path", sorted(FILES.glob("*.yaml")), ids=lambda path: path.stem)
def test_the_example_files_load_and_are_as_the_schema_says(path: Path) -> None:
    scenario = load_scenario(path)
    assert scenario.name == path.stem
    assert scenario.size == len(scenario.centers)
    assert jsonschema_rs.validator_for(Scenario.model_json_schema()).is_valid(
        parse_values(path.read_text(), "")
    )


def test_every_bad_file_has_its_remedy_listed() -> None:
    assert {path.stem for path in BAD_FILES.glob("*.yaml")} == set(REMEDIES)


@pytest.mark.parametrize("name", REMEDIES)
def test_bad_files_name_file_key_and_remedy(name: str) -> None:
    path = BAD_FILES / f"{name}.yaml"
    with pytest.raises(InputError) as caught:
        load_scenario(path)
    key, remedy = REMEDIES[name]
    assert caught.value.key == key
    assert str(caught.value).startswith(str(path))
    assert remedy in str(caught.value)
    assert "\n" not in str(caught.value)


def test_yaml_is_read_as_version_1_2(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(
        "name: no\norbit: {radius_m: 2e1, angular_rate_rad_s: 0.2}\n"
        "formation: {centers_m: [[0, 0], [7e1, 012]]}\nsensor: {range_m: 50}\n"
    )
    scenario = load_scenario(path)
    assert scenario.name == "no"
    assert scenario.orbit.radius_m == 20.0
    assert scenario.centers[1] == (70.0, 12.0)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("{? [1, 2] : 3}", "name: a dict with keys that are not text: must be"),
        ("&a [*a]", "its aliases expand to too many values"),
    ],
)
def test_what_yaml_can_say_and_json_cannot_is_refused_in_words(
    value: str, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "some.yaml"
    path.write_text(f"{json.dumps(document())[1:-1]}, name: {value}".join("{}"))
    with pytest.raises(InputError, match=words):
        load_scenario(path)


def _bomb(opening: bytes, levels: int) -> bytes:
    """A list whose aliases stand for ten to the power of `levels` values."""
    return (
        opening
        + b"".join(
            b", &a%d [%s]" % (k, b",".join([b"*a%d" % (k - 1)] * 10)) for k in range(1, levels)
        )
        + b"]"
    )


@pytest.mark.parametrize(
    ("content", "reported"),
    [
        (b"", "empty"),
        (b"   \n", "empty"),
        (b"\x7fELF\x00\x01\xff\xfe", "not text"),
        (b"[1, 2, 3]", "mapping"),
        (b"just words", "mapping"),
        (b"a: 1\na: 2\n", "duplicate"),
        (b"{" * 100_000, "deep"),
        (b"\x00\x01\x02", "not valid YAML"),
        (b'{"a": 1, "a": 2}', "duplicate"),
        (b"a: !!omap [b: 1, b: 2]", "not valid YAML: can't be read"),
        (b"a: !!timestamp 2026-13-45", "not valid YAML: month must be"),
        (b"orbit: {radius_m: &o [*o]}", "aliases expand to too many values"),
        (b"orbit: &o {radius_m: 1, sub: *o}", "aliases expand to too many values"),
        (_bomb(b"landmarks_m: [&a0 [0, 0]", 12), "aliases expand to too many values"),
        (_bomb(b"a0: [&a0 {? &b 1: 2}", 30), "aliases expand to too many values"),
    ],
)
def test_files_that_are_no_scenario_say_what_they_are(
    tmp_path: Path, content: bytes, reported: str
) -> None:
    path = tmp_path / "s.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=reported) as caught:
        load_scenario(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("first", [0, 999, 1000, 49_999])
def test_of_many_wrong_values_the_first_ones_are_reported_by_their_places(first: int) -> None:
    landmarks = [[0.0, float(k)] for k in range(50_000)]
    wrong = [{"}": 0}] * (50_000 - first)
    values = document(landmarks_m=[*landmarks[:first], *wrong])
    with pytest.raises(InputError, match=rf"landmarks_m\[{first}\]: .*must be a pair") as caught:
        scenario_from(values)
    assert [one.key for one in caught.value.faults[:1]] == [f"landmarks_m[{first}]"]
    assert len(caught.value.faults) <= 20


def test_of_many_wrong_names_the_first_ones_are_reported() -> None:
    values = document(landmarks_m={f"L{k}": 0 for k in range(50_000)})
    with pytest.raises(InputError, match=r"landmarks_m.L0: .*and 999 more"):
        scenario_from(values)


def test_missing_files_and_directories_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        load_scenario(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="directory"):
        load_scenario(tmp_path)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e308, "twenty", True, None, [], {}])
@pytest.mark.parametrize("key", ["orbit.radius_m", "sensor.range_m", "orbit.angular_rate_rad_s"])
def test_a_number_must_be_a_sensible_number(key: str, value: object) -> None:
    values = document()
    section, name = key.split(".")
    values[section] = {**values[section], name: value}
    if value is None and name == "angular_rate_rad_s":
        values["orbit"]["speed_mps"] = None
    error = _refused(values)
    assert error.key.startswith(key)


def test_a_speed_gives_the_rate() -> None:
    scenario = small(orbit={"radius_m": [20, 10], "speed_mps": [4, 2]})
    assert scenario.orbit.rate == pytest.approx(0.2)
    assert scenario.period == pytest.approx(10.0 * np.pi)


def test_names_come_from_mappings_or_lists() -> None:
    named = small(
        formation={"centers_m": {"alpha": [0, 0], "bravo": [70, 0]}, "links": [["bravo", "alpha"]]},
        landmarks_m={"mast": [100, 0]},
    )
    assert named.vehicle_names == ["alpha", "bravo"]
    assert named.landmark_names == ["mast"]


def test_a_resolved_scenario_states_its_defaults_and_centres_and_stays_itself() -> None:
    scenario = small(formation={"shape": "hex", "count": 5, "spacing_m": 70})
    resolved = scenario.resolved()
    assert resolved.formation.shape is None
    assert resolved.window_s == scenario.period
    assert resolved.centers == scenario.centers
    values = resolved.model_dump(mode="json", exclude_none=True)
    assert values["orbit"]["radius_m"] == 20.0
    assert values["initial_sigma"] == {"position_m": 5.0, "heading_rad": 0.1}
    again = scenario_from(values)
    assert again == resolved
    assert again.resolved() == resolved


def test_shapes_are_where_the_contract_says() -> None:
    def centers(**formation: Any) -> np.ndarray:
        return np.array(small(formation=formation).centers)

    np.testing.assert_allclose(
        centers(shape="line", count=3, spacing_m=70), [[0, 0], [70, 0], [140, 0]]
    )
    np.testing.assert_allclose(
        centers(shape="grid", count=4, columns=3, spacing_m=10), [[0, 0], [10, 0], [20, 0], [0, 10]]
    )
    hexagons = centers(shape="hex", count=4, columns=2, spacing_m=10)
    np.testing.assert_allclose(hexagons[2], [5.0, 10.0 * np.sqrt(3.0) / 2.0])
    ring = centers(shape="ring", count=5, spacing_m=72)
    chords = np.hypot(*(ring - np.roll(ring, -1, axis=0)).T)
    np.testing.assert_allclose(chords, 72.0)
    assert ring[0][1] == 0.0
    assert ring[1][1] > 0.0


def test_every_field_of_the_schema_is_described() -> None:
    schema = Scenario.model_json_schema()
    for name, part in schema["$defs"].items():
        for key, field in part.get("properties", {}).items():
            assert field.get("description"), f"{name}.{key}"


def test_broken_json_is_reported_as_json(tmp_path: Path) -> None:
    path = tmp_path / "s.json"
    path.write_text('{"orbit": ')
    with pytest.raises(InputError, match="not valid JSON"):
        load_scenario(path)


@pytest.mark.parametrize("moment", ["2026-05-01T09:00:00Z", "2026-05-01T09:00:00.25+02:00"])
def test_a_start_time_is_carried_through(moment: str, tmp_path: Path) -> None:
    assert small(start_time=moment).start_time == moment
    path = tmp_path / "s.yaml"
    path.write_text(
        f"start_time: {moment}\norbit: {{radius_m: 20, angular_rate_rad_s: 0.2}}\n"
        "formation: {centers_m: [[0, 0]]}\nsensor: {range_m: 50}\n"
    )
    assert load_scenario(path).start_time is not None


@pytest.mark.parametrize(
    ("section", "keys", "valid"),
    [
        ("orbit", {"radius_m": 20.0}, False),
        ("orbit", {"radius_m": 20.0, "angular_rate_rad_s": None}, False),
        ("orbit", {"radius_m": 20.0, "speed_mps": 4.0}, True),
        ("orbit", {"radius_m": 20.0, "speed_mps": 4.0, "angular_rate_rad_s": 0.2}, True),
        ("formation", {}, False),
        ("formation", {"centers_m": [[0.0, 0.0]]}, True),
        ("formation", {"centers_m": [[0.0, 0.0]], "count": None}, True),
        ("formation", {"centers_m": [[0.0, 0.0]], "count": 1}, False),
        ("formation", {"shape": "line", "count": 2, "spacing_m": 70.0}, True),
        ("formation", {"shape": "line", "count": 2, "gap_m": 30.0, "columns": 1}, True),
        ("formation", {"shape": "line", "count": 2}, False),
        ("formation", {"shape": "line", "spacing_m": 70.0}, False),
        ("formation", {"shape": "line", "count": 2, "spacing_m": 70.0, "gap_m": 30.0}, False),
        ("formation", {"links": [["v1", "v2"]], "count": 2}, True),
        ("formation", {"links": [["v1", "v2"]], "columns": 2}, False),
        ("refine", {"vary": []}, False),
        ("refine", {"vary": ["phases", "phases"]}, False),
        ("refine", {"vary": ["phases"]}, True),
    ],
)
def test_the_schema_shows_which_keys_go_together(
    section: str, keys: dict[str, Any], valid: bool
) -> None:
    values = document(**{section: keys})
    assert jsonschema_rs.validator_for(Scenario.model_json_schema()).is_valid(values) == valid
    if valid:
        scenario_from(values)
    else:
        _refused(values)


def test_landmarks_on_a_line_are_compared_with_their_neighbours_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    compared: list[Any] = []
    distance = math.dist

    def counted(a: Any, b: Any) -> float:
        compared.append(a)
        return distance(a, b)

    monkeypatch.setattr("syncplan.scenario.rules.math.dist", counted)
    line = [[0.0, 0.001 * k] for k in range(3000)]
    assert len(small(landmarks_m=line).landmarks) == 3000
    assert len(compared) < 3000
    # across the border of two cells, and in order along x
    error = _refused(document(landmarks_m=[*line, [-4e-7, 1.0], [5.0, 5.0], [5.0, 5.0]]))
    assert "L1001 and L3001 are at the same place" in str(error)


# --- copies ---------------------------------------------------------------------------------------


def test_a_copy_has_the_changed_keys_and_keeps_the_others() -> None:
    scenario = small()
    copied = scenario.model_copy(update={"min_separation_m": 3.0})
    assert copied.min_separation_m == 3.0
    assert copied.model_copy(update={"min_separation_m": 0.0}) == small(min_separation_m=0.0)
    assert copied.model_fields_set == scenario.model_fields_set | {"min_separation_m"}


@pytest.mark.parametrize(
    ("section", "changes", "message"),
    [
        ("sensor", {"range_m": -70}, "range_m: -70: must be greater"),
        ("sensor", {"rnage_m": 70.0}, "rnage_m: unknown key; did you mean range_m"),
        ("orbit", {"radius_m": None}, "radius_m"),
        ("", {"landmarks_m": {"v1": [0.0, 0.0]}}, "v1"),
        ("", {"min_separation_m": float("nan")}, "min_separation_m"),
    ],
)
def test_a_copy_that_no_file_could_state_is_refused(
    section: str, changes: dict[str, Any], message: str
) -> None:
    scenario = small()
    changed = getattr(scenario, section) if section else scenario
    with pytest.raises(InputError, match=message):
        changed.model_copy(update=changes)


def test_a_deep_copy_shares_nothing_that_can_change() -> None:
    scenario = small()
    deep = scenario.model_copy(deep=True)
    changed = scenario.model_copy(update={"min_separation_m": 1.0}, deep=True)
    for one in (deep, changed):
        assert one.formation.centers_m == scenario.formation.centers_m
        assert one.formation.centers_m is not scenario.formation.centers_m


def test_a_team_above_the_limit_can_be_copied() -> None:
    centers = [[70.0 * k, 0.0] for k in range(MAX_VEHICLES + 1)]
    keys = document(formation={"centers_m": centers}, duration_s=100.0)
    large = Scenario.model_validate(keys, context={"max_vehicles": MAX_VEHICLES + 1})
    formation = large.formation.model_copy(update={"centers_m": [*centers[1:], [-70.0, 0.0]]})
    assert large.model_copy(update={"formation": formation}).size == MAX_VEHICLES + 1
    with pytest.raises(InputError, match="more than the limit"):
        Scenario.from_mapping(keys)


def test_a_mapping_is_checked_as_a_file() -> None:
    assert Scenario.from_mapping(document()) == small()
    with pytest.raises(InputError, match="orbit: is missing"):
        Scenario.from_mapping({key: value for key, value in document().items() if key != "orbit"})
