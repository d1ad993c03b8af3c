// What is done with all that is selected, with links and with polygons.

import assert from "node:assert/strict";
import test from "node:test";
import { linksPresent, polygonsOf, withLinkToggled, withPolygon } from "../../api/page/scenario.js";
import { withAligned, withCopies, withPlaces, withoutChosen } from "../../api/page/selection.js";

const SCENARIO = {
  orbit: { radius_m: [20, 30], angular_rate_rad_s: 0.2, direction: "ccw" },
  formation: { centers_m: [[1, 2], [71, 0]], names: ["a", "b"], links: [["a", "b"]] },
  landmarks_m: [[0, -33]],
  sensor: [{ range_m: 50 }, { range_m: 60 }],
  altitude_m: [40, 55],
};
const ALL = [{ kind: "vehicle", k: 0 }, { kind: "landmark", k: 0 }];

test("all that is selected moves by as much, and nothing else does", () => {
  const changed = withPlaces(SCENARIO, ALL, ({ x, y }) => ({ x: x + 5, y: y - 1 }));
  assert.deepEqual(changed.formation.centers_m, [[6, 1], [71, 0]]);
  assert.deepEqual(changed.landmarks_m, [[5, -34]]);
  assert.deepEqual(SCENARIO.formation.centers_m[0], [1, 2]);
});

test("a selection is put on a grid", () => {
  const changed = withAligned(SCENARIO, ALL, 10);
  assert.deepEqual([changed.formation.centers_m[0], changed.landmarks_m[0]], [[0, 0], [0, -30]]);
});

test("a copy has the radius, sensor and altitude of what it was copied from, lies east of it, and is selected", () => {
  const { scenario, chosen } = withCopies(SCENARIO, ALL);
  assert.deepEqual(scenario.orbit.radius_m, [20, 30, 20]);
  assert.deepEqual(scenario.sensor[2], { range_m: 50 });
  assert.deepEqual(scenario.altitude_m, [40, 55, 40]);
  assert.deepEqual(scenario.formation.names, ["a", "b", "v3"]);
  // the circle of a reaches from -19 to 21
  assert.deepEqual(scenario.formation.centers_m[2], [49, 2]);
  assert.deepEqual(scenario.landmarks_m[1], [48, -33]);
  assert.deepEqual(chosen, [{ kind: "vehicle", k: 2 }, { kind: "landmark", k: 1 }]);
});

test("what is selected goes with its links, and one vehicle stays", () => {
  const changed = withoutChosen(SCENARIO, [{ kind: "vehicle", k: 0 }, { kind: "vehicle", k: 1 }, { kind: "landmark", k: 0 }]);
  assert.deepEqual(changed.formation.names, ["a"]);
  assert.deepEqual([changed.formation.links, changed.landmarks_m], [[], []]);
});

test("a link is drawn and removed, and links that follow reach are listed first", () => {
  assert.deepEqual(withLinkToggled(SCENARIO, null, ["b", "a"]).formation.links, []);
  const { links, ...formation } = SCENARIO.formation;
  const free = { ...SCENARIO, formation: { ...formation, centers_m: [[1, 2], [71, 0], [140, 0]], names: ["a", "b", "c"] } };
  const plan = { links: [{ a: "a", b: "b" }], dropped_links: [{ a: "b", b: "gone" }] };
  assert.deepEqual(linksPresent(free, plan), links);
  assert.deepEqual(withLinkToggled(free, plan, ["b", "c"]).formation.links, [["a", "b"], ["b", "c"]]);
});

test("polygons are added, changed and taken out, and an empty list leaves the scenario", () => {
  const [square, triangle] = [[[0, 0], [1, 0], [1, 1], [0, 1]], [[5, 5], [6, 5], [5, 6]]];
  const two = withPolygon(withPolygon(withPolygon(SCENARIO, "area", square), "obstacle", square), "obstacle", triangle);
  assert.deepEqual(polygonsOf(two).map(({ kind, k }) => `${kind} ${k}`), ["area 0", "obstacle 0", "obstacle 1"]);
  assert.deepEqual(withPolygon(two, "obstacle", triangle, 0).obstacles_m, [triangle, triangle]);
  assert.deepEqual(withPolygon(two, "obstacle", null, 0).obstacles_m, [triangle]);
  const none = withoutChosen(two, [{ kind: "obstacle", k: 0 }, { kind: "obstacle", k: 1 }, { kind: "area", k: 0 }]);
  assert.equal("obstacles_m" in none || "area_m" in none, false);
});
