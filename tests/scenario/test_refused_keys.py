"""Scenarios that are refused, each with the key at fault and the remedy in one line."""

from typing import Any

import pytest

from syncplan.errors import InputError
from syncplan.scenario.loading import parse_values
from tests.tools.scenarios import small

REFUSED = r"""
formation: {centers_m: []} -> formation.centers_m: empty
formation: {} -> formation.centers_m: missing
formation: {shape: ring, count: 3} -> formation.spacing_m: missing
formation: {shape: blob, count: 3, spacing_m: 7} -> formation.shape: blob
formation: {centers_m: [[0, 0]], shape: ring} -> formation.shape: one of the two
formation: {centers_m: [[0, 0, 0]]} -> formation.centers_m[0]: at most 2
formation: {centers_m: [[0, 0], [70, 0]], links: [[v1, v1]]} -> formation.links[0]: itself
formation: {centers_m: [[0, 0], [9, 0]], links: [[v1, v2], [v2, v1]]} -> formation.links[1]: twice
formation: {centers_m: [[0, 0], [70, 0]], names: [a, a]} -> formation.names: twice
formation: {centers_m: [[0, 0], [70, 0]], names: [a]} -> formation.names: 1
formation: {centers_m: {a: [0, 0], b: [70, 0]}, names: [c, d]} -> formation.names: already gives
formation: {shape: line, count: 4, spacing_m: 5e6} -> formation.spacing_m: at 1.5e+07 m
formation: {shape: grid, count: 4, columns: 1000000000000000000000} -> formation.columns: at most
formation: {shape: line, count: 10001, spacing_m: 70} -> formation.count: 10001 vehicles are more
formation: {shape: line, count: 10001, spacing_m: 70} -> formation.count: raise it with --max-veh
{formation: {links: [[v1, v2]], names: []}, sensor: []} -> formation.names: empty
landmarks_m: {v1: [1, 2]} -> landmarks_m: twice
landmarks_m: [[5, 5], [9, 9], [5, 5]] -> landmarks_m: L1 and L3
sensor: [{range_m: 5}] -> sensor: 2 vehicles
sensor: [{range_m: 50}, {range_m: 50, sample_time_s: 0.2}] -> sensor: common sample_time_s
sensor: {range_m: 50, interval_s: 0.05} -> sensor.interval_s: multiple of sample_time_s
sensor: {range_m: 50, detection_probability: 0.0} -> sensor.detection_probability: greater
sensor: {range_m: 50, detection_probability: 1.1} -> sensor.detection_probability: at most
sensor: {range_m: 50, range_sigma_m: 0.0} -> sensor.range_sigma_m: 0.000001
sensor: {range_m: 5, bearing_walk: {sigma_rad: 1, time_s: 0}} -> sensor.bearing_walk.time_s: 0.001
duration_s: 1e9 -> duration_s: samples
duration_s: 0.01 -> duration_s: sample_time_s
window_s: 1e9 -> window_s: samples
{orbit: {radius_m: 20, angular_rate_rad_s: 1e-5}, window_s: 60} -> orbit: a period of
{duration_s: 1e7, window_s: 100, sensor: {range_m: 9, sample_time_s: 100}} -> duration_s: periods
orbit: {radius_m: 1e-300, speed_mps: 1} -> orbit.radius_m: at least 1e-06
orbit: {radius_m: [20, 10], speed_mps: 4} -> orbit.speed_mps: one common rate
orbit: {radius_m: 20} -> orbit.angular_rate_rad_s: speed_mps
orbit: {radius_m: 9, speed_mps: 4, direction: [ccw, alternate]} -> orbit.direction: stands alone
orbit: {radius_m: [20, 20, 20], speed_mps: 4} -> orbit.radius_m: 3 values
orbit: {radius_m: 0.01, speed_mps: 200} -> orbit.speed_mps: gives 20000 rad/s
orbit: {radius_m: [], speed_mps: []} -> orbit.speed_mps: has 0 values for 0 radii
name: "two\nlines" -> name: two
start_time: "2026-W20-1T09+00:00" -> start_time: RFC 3339
start_time: yesterday -> start_time: RFC 3339
start_time: "2026-05-01T09:00:00" -> start_time: time zone
purpose: {cover: {share: 0.5, swath_m: 10.0}} -> area_m: is missing: purpose.cover
purpose: {keep: {count: 3, spread_m: 10.0}} -> purpose.keep.count: number of vehicles, 2
purpose: {within_m: 3.0} -> purpose.cover: give cover, visit_m or keep
motion: {turn_rate_sigma_rad_s: 0.1, angle_random_walk_rad_sqrt_s: 0.03} -> WALK: one of the two
filter: {estimate: [bearing_walk]} -> filter.estimate[0]: give sensor.bearing_walk.sigma_rad
filter: {estimate: wind} -> filter.estimate: or a list of wind, speed_scale
filter: {estimate: null} -> filter.estimate: must be auto, all, none or a list
filter: {estimate: [gusts, winds]} -> filter.estimate[1]: must be one of wind
filter: {estimate: [[wind]]} -> filter.estimate[0]: must be one of wind
filter: {estimate: [speed_scale]} -> filter.estimate[0]: give motion.speed_scale_sigma
{filter: {estimate: [wind, wind]}, wind: {sigma_mps: 1.0}} -> filter.estimate: twice
heading_interval_s: 0.5 -> heading_interval_s: heading_sigma_rad is given
{heading_sigma_rad: 0.1, heading_interval_s: 0.25} -> heading_interval_s: multiple of sample_time_s
heading_sigma_rad: [0.1, 0.1, 0.1] -> heading_sigma_rad: 2 vehicles
wind: {sigma: 1.0} -> wind.sigma: sigma_mps
wind: {gust_time_s: 0.0} -> wind.gust_time_s: 0.001
wind: 3 -> wind: must be a section of keys
obstacles_m: [[[0, 0, 0]]] -> obstacles_m[0][0]: at most 2 items, not 3
obstacles_m: [[[0, 0], [1, 0]]] -> obstacles_m[0]: corners
obstacles_m: [[0, 0], [1, 0], [0, 1]] -> obstacles_m: is one polygon; give a list
obstacles_m: [[[0, 0], [1, 0], [0, 1]], [[0, 0], [2, 2], [2, 0], [0, 2]]] -> obstacles_m[1]: cross
keep_out_m: [[0, 0], [1, 0], [0, 1]] -> keep_out_m: is one polygon; give a list
keep_out_m: [[[0, 0], [9, 9], [9, 0], [1, 9]]] -> keep_out_m[0]: is not a simple polygon
area_m: [] -> area_m: has 0 corners
area_m: [[0, 0], [1, 1], [2, 2]] -> area_m: encloses nothing
limits: {speed_mps: [6, 5]} -> limits.speed_mps: [6.0, 5.0]: the least is larger
limits: {speed_mps: [5, 6]} -> limits.speed_mps: v1 flies 4 m/s
limits: {turn_rate_rad_s: 0.1} -> limits.turn_rate_rad_s: 0.1: the orbits turn at
refine: {objective: best} -> refine.objective: 'best': must be
refine: {center_box_m: 0} -> refine.center_box_m: 0: must be greater than 0
truth: {orbit: {}} -> truth.orbit: unknown key; allowed: sensor
truth: {filter: {}} -> truth.filter: unknown key
truth: {sensor: {sample_time_s: 0.2}} -> truth.sensor.sample_time_s: unknown key
truth: {wind: {gust_sigma_mps: -1.0}} -> truth.wind.gust_sigma_mps: -1.0: must be at least
truth: {sensor: {interval_s: 0.25}} -> truth.sensor.interval_s: 0.25: is not a multiple
truth: {sensor: [{range_m: 40.0}]} -> truth.sensor: has 1 values for 2 vehicles
truth: {sensor: {range_sigma_m: 0.3}} -> truth.sensor.range_sigma_m: the scenario has no
truth: {heading_sigma_rad: 0.1} -> truth.heading_sigma_rad: the scenario has no
truth: {false_bearings: 1.0} -> truth.false_bearings: 1.0: must be less
geo_origin: {lat_deg: 91, lon_deg: 0} -> geo_origin.lat_deg: 90
geo_origin: {lat_deg: 0, lon_deg: -180.5} -> geo_origin.lon_deg: -180
geo_origin: {lat_deg: 0, lon_deg: 0, alt_m: 1e6} -> geo_origin.alt_m: at most
geo_origin: {lat_deg: 0} -> geo_origin.lon_deg: missing
geo_origin: {lat_deg: 0, lon_deg: 0, heading: 1} -> geo_origin.heading: unknown key
geo_origin: {lat_deg: .nan, lon_deg: 0} -> geo_origin.lat_deg: finite
"""
"""What is changed of a small scenario -> the key at fault: words of the message."""

CORNERS = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]


def check(changes: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        small(**changes)
    assert caught.value.key == key
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("line", REFUSED.strip().splitlines())
def test_a_key_that_cannot_be_meant_is_refused_by_name(line: str) -> None:
    changes, _, problem = line.partition(" -> ")
    key, _, words = problem.replace("WALK", "motion.angle_random_walk_rad_sqrt_s").partition(": ")
    check(parse_values(changes, ""), key, words)


def test_what_a_line_cannot_hold_is_refused_by_name_too() -> None:
    check({"start_time": "\ud800"}, "start_time", "RFC 3339")
    check({"landmarks_m": {"a\nb": [1, 2]}}, "landmarks_m.a\nb", "pattern")
    check({"obstacles_m": [CORNERS] * 334}, "obstacles_m", "1002 corners in all, more than 1000")
