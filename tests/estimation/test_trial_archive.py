"""A validation cut into parts, kept as bytes and joined, is the validation run in one."""

import pytest

from syncplan.errors import InputError
from syncplan.estimation.trials import pack, unpack
from syncplan.planning.planner import plan
from syncplan.planning.validation import conclude, run_part, trial_run, validate
from syncplan.reports.validation_report import validation_document
from syncplan.runtime.files import as_text
from tests.tools.scenarios import example, small


@pytest.mark.parametrize("with_series", [False, True])
def test_a_run_in_parts_gives_the_report_of_the_whole_to_the_byte(with_series: bool) -> None:
    flown = plan(example("biased-grid"))
    whole = validate(flown, trials=70, seed=3, duration=20.0, with_series=with_series)
    run = trial_run(flown, trials=70, seed=3, duration=20.0, with_series=with_series)
    cuts = [(0, 16), (16, 48), (64, 6)]
    parts = [unpack(pack(run_part(run, first, count, threads=1))) for first, count in cuts]
    reports = [as_text(validation_document(one).as_json()) for one in (whole, conclude(run, parts))]
    assert reports[0] == reports[1]


def test_a_missing_part_is_refused() -> None:
    run = trial_run(example("paper-grid-same"), trials=32, duration=2.0)
    part = run_part(run, 0, 16)
    with pytest.raises(InputError, match="16 from 0 on given, of 32"):
        conclude(run, [part])


@pytest.mark.parametrize("data", [b"", b"nothing", b"PK\x03\x04 an archive cut short"])
def test_bytes_that_are_no_part_are_refused(data: bytes) -> None:
    with pytest.raises(InputError, match="not a part of a run"):
        unpack(data)


def test_every_fault_of_a_scenario_is_listed_with_its_key_and_value() -> None:
    orbit = {"radius_m": -1.0, "direction": "up", "angular_rate_rad_s": 0.2, "colour": 3}
    with pytest.raises(InputError) as caught:
        small(orbit=orbit)
    faults = caught.value.faults
    assert [(one.key, one.value) for one in faults if "unknown" in one.problem] == [
        ("orbit.colour", "")
    ]
    assert {one.key: one.value for one in faults}["orbit.radius_m"] == "-1.0"
    assert len(faults) >= 3
    assert f"and {len(faults) - 1} more" in str(caught.value)
