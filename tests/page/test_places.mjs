// Places in degrees: those of a file of the field in a scenario, and positions shown and typed.

import assert from "node:assert/strict";
import test from "node:test";
import { coordinatesOf, cornersIn, pairIn, placedField } from "../../api/page/coordinates.js";
import { middleOf, placeOf, pointOf } from "../../api/page/earth.js";
import { placesFrom, withDegrees, withPlaced } from "../../api/page/importing.js";

const ORIGIN = { lat_deg: 47.3977, lon_deg: 8.5456 };
const SCENARIO = { formation: { centers_m: [[0, 0], [70, 0]] }, orbit: { radius_m: 20 }, landmarks_m: { old: [0, 60] }, keep_out_m: [[[0, 0], [1, 0], [0, 1]]] };
const MEADOW = [[47.396, 8.543], [47.396, 8.548], [47.399, 8.548], [47.399, 8.543]];
const POND = [[47.3985, 8.5455], [47.3985, 8.5458], [47.3987, 8.5458]];
const FEATURES = [
  { name: "Meadow", geometry: "polygon", lat_lon_deg: MEADOW, holes_lat_lon_deg: [POND] },
  { name: "Barn", geometry: "polygon", lat_lon_deg: POND, holes_lat_lon_deg: [] },
  { name: "Mast", geometry: "point", lat_lon_deg: [[47.397, 8.546]], holes_lat_lon_deg: [] },
  { name: "Mast", geometry: "point", lat_lon_deg: [[47.398, 8.546]], holes_lat_lon_deg: [] },
];
const near = (point, other, metres = 1e-3) => assert.ok(Math.hypot(point[0] - other[0], point[1] - other[1]) < metres, `${point} is not ${other}`);

test("holes of the area become keep-outs, landmarks have names of their own, and what is left out is in no key", () => {
  const places = placesFrom(FEATURES, ["area", "left_out", "landmark", "landmark"]);
  assert.deepEqual(places, { area: MEADOW, keep_out: [POND], landmarks: { Mast: [47.397, 8.546], "Mast 2": [47.398, 8.546] } });
  assert.deepEqual(placesFrom(FEATURES, ["left_out", "obstacle", "left_out", "left_out"]), { obstacles: [POND] });
});

test("added places lie where the origin has them, and what the file has none of stays", () => {
  const changed = withPlaced({ ...SCENARIO, geo_origin: { ...ORIGIN, alt_m: 488 } }, placesFrom(FEATURES, ["area", "obstacle", "left_out", "left_out"]));
  for (const [k, place] of MEADOW.entries()) near(changed.area_m[k], pointOf(ORIGIN, place));
  near(changed.keep_out_m[0][2], pointOf(ORIGIN, POND[2]));
  assert.equal(changed.obstacles_m.length, 1);
  assert.deepEqual(changed.landmarks_m, SCENARIO.landmarks_m);
  assert.equal(changed.geo_origin.alt_m, 488);
});

test("without an origin, it is the middle of what was chosen", () => {
  const changed = withPlaced(SCENARIO, placesFrom(FEATURES, ["area", "left_out", "left_out", "left_out"]));
  assert.deepEqual(changed.geo_origin, { lat_deg: 47.3975, lon_deg: 8.5455, alt_m: 0 });
  const [xs, ys] = [0, 1].map((k) => changed.area_m.map((corner) => corner[k]));
  near([Math.min(...xs) + Math.max(...xs), Math.min(...ys) + Math.max(...ys)], [0, 0], 0.05);
});

test("the middle of places about the antimeridian lies between them", () => {
  const { lat_deg, lon_deg } = middleOf([[-17, 179.99], [-17, -179.97]]);
  assert.ok(Math.abs(lat_deg + 17) < 1e-5);
  assert.ok(Math.abs(lon_deg + 179.99) < 1e-6, `${lon_deg}`);
});

test("places that the plane does not reach are refused in words", () => {
  const elsewhere = withPlaced.bind(null, { ...SCENARIO, geo_origin: { lat_deg: -33.9, lon_deg: 151.2, alt_m: 0 } });
  assert.throws(() => elsewhere({ area: MEADOW }), /47\.396, 8\.543 is no place within 1000 km .* 33\.900000° S/);
  const { taken } = coordinatesOf({ scenario: { ...SCENARIO, geo_origin: ORIGIN }, degrees: true });
  // beyond the pole, and on the other side of the earth
  for (const place of [[90.1, 8.5], [-47.3977, -171.4544]]) assert.throws(() => taken(place), RangeError);
});

test("a new scenario has the places chosen, in degrees, and none of those that were not", () => {
  const begun = withDegrees({ name: "field", orbit: {}, area_lat_lon_deg: POND, landmarks_lat_lon_deg: { a: [47, 8] } }, { area: MEADOW });
  assert.deepEqual(begun, { name: "field", orbit: {}, area_lat_lon_deg: MEADOW });
});

test("a pair is two numbers, and nothing else", () => {
  for (const text of ["47.3977, 8.5456", " 47.3977 8.5456\n", "47.3977;8.5456"]) assert.deepEqual(pairIn(text), [47.3977, 8.5456]);
  for (const text of ["", "47.3977", "47.3977,", "47,3977, 8,5456", "a, b"]) assert.equal(pairIn(text), null);
});

test("positions are metres unless degrees are switched on and there is an origin", () => {
  const scenario = { ...SCENARIO, geo_origin: ORIGIN };
  for (const state of [{ scenario, degrees: false }, { scenario: SCENARIO, degrees: true }]) {
    const { field, of, taken, words } = coordinatesOf(state);
    assert.deepEqual([field.unit, of([190, 70]), taken([190, 70]), words({ x: 190, y: 70 })], ["m", [190, 70], [190, 70], "190, 70 m"]);
  }
  const { field, of, shown, taken, words } = coordinatesOf({ scenario, degrees: true });
  assert.deepEqual([field.unit, words({ x: 0, y: 0 })], ["°", "47.397700° N, 8.545600° E"]);
  for (const point of [[0, 0], [-2500, 4000], [90_000, -70_000]]) near(taken(of(point).map(shown)), point, 2e-3);
});

test("corners that are not typed anew stay as they are", () => {
  const store = { degrees: true };
  const corners = [[0.12345678, 1], [40, 1], [40, 30]];
  const scenario = { ...SCENARIO, geo_origin: ORIGIN, keep_out_m: [corners] };
  const { read, change } = placedField(store, { read: (scenario) => scenario.keep_out_m, change: (scenario, value) => ({ ...scenario, keep_out_m: value }) });
  const shown = read(scenario);
  near(shown[0][1], placeOf(ORIGIN, corners[1]), 1e-8);
  shown[0][2] = [47.398, 8.546];
  const [changed] = change(scenario, shown).keep_out_m;
  assert.deepEqual(changed.slice(0, 2), corners.slice(0, 2));
  near(changed[2], pointOf(ORIGIN, [47.398, 8.546]));
  // what is malformed is for the service to refuse
  assert.deepEqual(change(scenario, [["a"], 3]).keep_out_m, [["a"], 3]);
});

test("corners are pairs: one with a third number is refused, not read as others", () => {
  assert.deepEqual(cornersIn("0, 0; 100, 0; 100, 50;"), [[0, 0], [100, 0], [100, 50]]);
  for (const text of ["0, 0; 100, 0, 0; 50, 100, 1", "0, 0; 100; 0, 100; 50, 100, 50", "0, 0; 100, 0", "0, 0; a, 0; 1, 1"]) assert.throws(() => cornersIn(text), RangeError);
});
