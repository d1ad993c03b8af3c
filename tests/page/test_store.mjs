// The page's state: what an edit, an undo and a selection make of it.

import assert from "node:assert/strict";
import test from "node:test";
import { movedTo } from "../../api/page/grips.js";
import { switched } from "../../api/page/losses.js";
import { circlesOf, linksOf, pointsOf } from "../../api/page/marks.js";
import { Store } from "../../api/page/store.js";

const SCENARIO = {
  name: "pair",
  orbit: { radius_m: 20, angular_rate_rad_s: 0.2, direction: "alternate" },
  formation: { centers_m: [[0, 0], [70, 0]] },
  landmarks_m: { south: [0, -30] },
  sensor: { range_m: 50, fov_deg: 360, boresight_deg: 0 },
};

/** A plan of the pair, of which the store knows no more than this. */
function planned({ method = "consensus", scenario = SCENARIO } = {}) {
  const vehicle = (name, x, direction, phase_rad) => ({ name, center_m: [x, 0], radius_m: 20, direction, phase_rad });
  return { scenario, period_s: 31.4, synchronisation: { method }, vehicles: [vehicle("v1", 0, "ccw", 0.5), vehicle("v2", 70, "cw", 2.5)] };
}

function opened() {
  const store = new Store();
  store.open({ plan: planned(), planId: "p1" });
  return store;
}

const moved = (store, grip, to, how) => {
  const { scenario, phase } = movedTo(store.scenario, store.drawn, grip, to, 0);
  store.edit(scenario, { ...how, phase });
};

test("a drag is one step, and undo brings back what was there with its identifier", () => {
  const store = opened();
  moved(store, { kind: "vehicle", k: 1 }, { x: 71, y: 0 }, { live: true });
  for (const x of [72, 73]) moved(store, { kind: "vehicle", k: 1 }, { x, y: 0 }, { live: true, step: false });
  assert.deepEqual(store.scenario.formation.centers_m[1], [73, 0]);
  assert.equal(store.planId, null);
  store.undo();
  assert.deepEqual(store.scenario.formation.centers_m[1], [70, 0]);
  assert.equal(store.planId, "p1");
  assert.equal(store.canUndo, false);
});

test("a radius dragged is that of one vehicle", () => {
  const store = opened();
  moved(store, { kind: "radius", k: 0 }, { x: 15, y: 0 });
  assert.deepEqual(store.scenario.orbit.radius_m, [15, 20]);
});

test("a phase set by hand gives all phases, until an edit moves an orbit", () => {
  const store = opened();
  moved(store, { kind: "phase", k: 1 }, { x: 70, y: 20 });
  assert.equal(store.document.vehicles.length, 2);
  assert.equal(store.document.vehicles[0].phase_rad, 0.5);
  assert.ok(Math.abs(store.document.vehicles[1].phase_rad - Math.PI / 2) < 1e-12);
  assert.equal(store.planId, null);
  assert.equal(store.given.origin, "hand");
  store.edit({ ...store.scenario, name: "another" });
  assert.ok(store.given);
  moved(store, { kind: "vehicle", k: 0 }, { x: 5, y: 0 });
  assert.equal(store.given, null);
  assert.equal(store.lost, "hand");
  store.undo();
  assert.ok(Math.abs(store.given.vehicles[1].phase_rad - Math.PI / 2) < 1e-12);
});

test("a phase at a moment of the period is that of its start", () => {
  const store = opened();
  const turned = Math.PI / 2;
  // v2 turns clockwise: a quarter of a turn before (70, -20) it was at (90, 0)
  const { phase } = movedTo(store.scenario, store.drawn, { kind: "phase", k: 1 }, { x: 70, y: -20 }, turned);
  assert.ok(Math.abs(Math.sin(phase.phase_rad)) < 1e-12 && Math.cos(phase.phase_rad) > 0);
});

test("an edit, a phase set by hand and a new team are unsaved until they are stored or undone", () => {
  const store = new Store();
  assert.equal(store.unsaved, false);
  store.open({ plan: planned() });
  assert.equal(store.unsaved, false);
  moved(store, { kind: "vehicle", k: 1 }, { x: 71, y: 0 });
  assert.equal(store.unsaved, true);
  store.undo();
  assert.equal(store.unsaved, false);
  moved(store, { kind: "phase", k: 1 }, { x: 70, y: 20 });
  assert.equal(store.unsaved, true);
  store.stored("p2");
  assert.equal(store.unsaved, false);
  store.open({ plan: planned(), fresh: true });
  assert.equal(store.unsaved, true);
});

test("a body is selected alone, or beside others, and once more no longer", () => {
  const store = opened();
  const [first, second] = [{ kind: "vehicle", k: 0 }, { kind: "landmark", k: 0 }];
  store.select(first);
  store.select(second, { more: true });
  assert.deepEqual(store.chosen, [first, second]);
  assert.deepEqual(store.selected, second);
  store.select(second, { more: true });
  assert.deepEqual(store.chosen, [first]);
  store.select(second);
  assert.deepEqual(store.chosen, [second]);
  store.select(null);
  assert.equal(store.selected, null);
});

test("parts are switched off together, and an edit, undo or another plan switches them on", () => {
  const store = opened();
  const heard = [];
  store.on(["off"], () => heard.push([...store.off]));
  store.switchOff(["v2", "south"]);
  store.judgedWithout(["v2"], { rank: 1 });
  assert.equal(store.without, null);
  store.judgedWithout(store.off, { rank: 2 });
  assert.equal(store.without.rank, 2);
  store.edit({ ...store.scenario, name: "other" });
  assert.deepEqual([store.off, store.without], [[], null]);
  store.switchOff(["v1"]);
  store.undo();
  assert.deepEqual(store.off, []);
  assert.deepEqual(heard, [["v2", "south"], ["v2", "south"], [], ["v1"], []]);
});

test("a vehicle and a sensor of it take each other's place among what is off", () => {
  assert.deepEqual(switched(["L1"], "v1"), ["L1", "v1"]);
  assert.deepEqual(switched(["L1", "v1"], "L1"), ["v1"]);
  assert.deepEqual(switched(["sensor:v1", "compass:v1", "sensor:v2"], "v1"), ["sensor:v2", "v1"]);
  assert.deepEqual(switched(["v1", "v2"], "sensor:v1"), ["v2", "sensor:v1"]);
});

test("a link is off with its bodies, or once nothing sees along it; the rest keeps its rank and meetings", () => {
  const plan = {
    ...planned(),
    links: [{ a: "v1", b: "v2", rank: 3 }],
    dropped_links: [],
    landmark_links: [{ vehicle: "v1", landmark: "south", rank: 2 }],
  };
  const seen = (off) => linksOf(plan, circlesOf(SCENARIO, plan, off), pointsOf(SCENARIO, off)).map(({ off: isOff, rank, arcs }) => [isOff, rank, arcs.length > 0]);
  const [link, landmark] = seen([]);
  assert.deepEqual([link[0], landmark], [false, [false, 2, true]]);
  assert.deepEqual(seen(["v2"]), [[true, 3, false], landmark]);
  assert.deepEqual(seen(["south"]), [link, [true, 2, false]]);
  assert.deepEqual(seen(["sensor:v1"]), [link, [true, 2, false]]);
  assert.deepEqual(seen(["sensor:v1", "sensor:v2"])[0], [true, 3, false]);
});
