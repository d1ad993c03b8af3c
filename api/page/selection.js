// What is done with all that is selected: it is moved, copied, put on a grid, removed.

import { roomiest, withMember } from "./free_space.js";
import { extentOf } from "./marks.js";
import { addLandmark, landmarksOf, mean, polygonsOf, round, rounded, vehiclesOf, withCenter, withLandmark, withLandmarkName, withPolygon, withVehicleName, withoutLandmark, withoutVehicle } from "./scenario.js";

/** @typedef {{kind: string, k: number}} Chosen what is selected: a vehicle, landmark or polygon, by its number */

/** What a map has places of: all of a kind, and the scenario with one moved, named, added or removed. */
export const BODIES = {
  vehicle: { all: vehiclesOf, moved: withCenter, named: withVehicleName, added: withMember, removed: withoutVehicle },
  landmark: { all: landmarksOf, moved: withLandmark, named: withLandmarkName, added: addLandmark, removed: withoutLandmark },
};

/** The vehicles and landmarks of these names. @returns {Chosen[]} */
export function bodiesNamed(scenario, names) {
  return Object.entries(BODIES).flatMap(([kind, { all }]) => all(scenario).flatMap(({ name }, k) => (names.includes(name) ? [{ kind, k }] : [])));
}

/** The selected vehicles and landmarks with their places. */
export function placesOf(scenario, chosen) {
  return chosen
    .map(({ kind, k }) => ({ radius: 0, ...BODIES[kind]?.all(scenario)[k], kind, k }))
    .filter((one) => "x" in one);
}

/** Return the scenario with all that is selected put where `place({ x, y })` says. */
export function withPlaces(scenario, chosen, place) {
  return placesOf(scenario, chosen).reduce((changed, one) => {
    const { x, y } = place(one);
    return BODIES[one.kind].moved(changed, one.k, round(x), round(y));
  }, scenario);
}

/** Return the scenario with the selection on a grid of so many m. */
export function withAligned(scenario, chosen, step) {
  return withPlaces(scenario, chosen, ({ x, y }) => ({ x: step * Math.round(x / step), y: step * Math.round(y / step) }));
}

/** Return the scenario with a copy of the selection east of it, and what is selected then.
 * @returns {{scenario: any, chosen: Chosen[]}} */
export function withCopies(scenario, chosen) {
  const places = placesOf(scenario, chosen);
  const west = Math.min(...places.map(({ x, radius }) => x - radius));
  const east = Math.max(...places.map(({ x, radius }) => x + radius));
  const by = round(1.2 * (east - west) || 1);
  const made = [];
  const changed = places.reduce((old, { kind, k, x, y }) => {
    made.push({ kind, k: BODIES[kind].all(old).length });
    return BODIES[kind].added(old, { x: round(x + by), y }, k);
  }, scenario);
  return { scenario: changed, chosen: made };
}

/** Return the scenario without what is selected; the last vehicle stays. */
export function withoutChosen(scenario, chosen) {
  const last = [...chosen].sort((one, other) => other.k - one.k);
  return last.reduce((changed, { kind, k }) => {
    if (kind === "vehicle" && vehiclesOf(changed).length === 1) return changed;
    return kind in BODIES ? BODIES[kind].removed(changed, k) : withPolygon(changed, kind, null, k);
  }, scenario);
}

/** Add a vehicle or landmark to a store's scenario and select it, as `select` has it. */
export function addBody(store, kind, at, how = {}) {
  const { added, all } = BODIES[kind];
  store.edit(added(store.scenario, at));
  store.select({ kind, k: all(store.scenario).length - 1 }, how);
}

/** Add a polygon to a store's scenario, the area round all that is there and others small, and select it. */
export function withPolygonAdded(store, kind) {
  const { scenario } = store;
  const radius = mean(vehiclesOf(scenario).map((vehicle) => vehicle.radius));
  const whole = extentOf(scenario);
  const { x, y, room } = kind === "area" ? { x: 0, y: 0, room: 0 } : roomiest(scenario, whole);
  const size = rounded(Math.min(Math.max(room / 2, radius / 10), radius / 2), 1);
  const [west, south, east, north] = (kind === "area" ? whole : [x, y, x, y]).map((edge, at) => round(edge + (at < 2 ? -size : size)));
  store.edit(withPolygon(scenario, kind, [[west, south], [east, south], [east, north], [west, north]]));
  const { k } = polygonsOf(store.scenario).findLast((polygon) => polygon.kind === kind);
  store.select({ kind, k }, { reveal: true });
}

/** Copy what is selected in a store, or was when it was clipped, and select the copies. */
export function copyChosen(store, clipped = store.chosen) {
  const { scenario, chosen } = withCopies(store.scenario, clipped);
  if (!chosen.length) return;
  store.edit(scenario);
  store.selectAll(chosen);
}

/** Remove what is selected in a store. */
export function removeChosen(store) {
  const { scenario, chosen } = store;
  store.select(null);
  if (chosen.length) store.edit(withoutChosen(scenario, chosen));
}
