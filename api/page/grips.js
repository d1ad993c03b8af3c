// What can be taken hold of on the map: centres and landmarks, of the one selected vehicle its
// radius and its phase, of the selected polygon its corners. Each grip knows the edit that moving it makes.

import { shown } from "./elements.js";
import { TURN } from "./geometry.js";
import { circlesOf, poseAt } from "./marks.js";
import { landmarksOf, placesIn, polygonAt, rounded, withPolygon, withRadius } from "./scenario.js";
import { BODIES } from "./selection.js";

/**
 * @typedef {{kind: string, k: number, x: number, y: number, title: string, label: string, polygon?: any}} Grip
 * `kind` is "vehicle" (its centre), "landmark", "radius", "phase" or "corner"; `k` counts vehicles, landmarks, or the corners
 * of a polygon `{ kind, k, corners }`
 */

/** angle at which the grip of a radius lies on its circle, in rad */
const AT = Math.PI / 4;
const LEAST_RADIUS_M = 0.01;

/** The bodies of a scenario, as grips; `place` words their places. @returns {(Grip & {radius: number})[]} */
export function bodiesOf(scenario, plan, place = placesIn(scenario)) {
  const vehicles = circlesOf(scenario, plan).map((one, k) => ({ ...one, kind: "vehicle", k, title: one.name, label: `Circle of ${one.name}, centre at ${place(one)}` }));
  const landmarks = landmarksOf(scenario).map((one, k) => ({ ...one, radius: 0, kind: "landmark", k, title: one.name, label: `Landmark ${one.name} at ${place(one)}` }));
  return [...vehicles, ...landmarks];
}

/** All grips: those of bodies, and of the selected vehicle those of its circle, after an angle was turned.
 * @returns {Grip[]} */
export function gripsOf(scenario, plan, selected, turned, place = placesIn(scenario)) {
  const circle = selected?.kind === "vehicle" ? circlesOf(scenario, plan)[selected.k] : null;
  const bodies = bodiesOf(scenario, plan, place);
  if (!circle) return [...bodies, ...cornersOf(scenario, selected, place)];
  const { name, x, y, radius } = circle;
  const rim = { x: x + radius * Math.cos(AT), y: y + radius * Math.sin(AT) };
  const own = [{ kind: "radius", k: selected.k, ...rim, title: `radius of ${name}`, label: `Radius of ${name}, ${shown(radius, "m")}` }];
  const planned = plan?.vehicles.some((one) => one.name === name);
  if (planned) {
    const phase = degrees(circle.phase);
    own.push({ kind: "phase", k: selected.k, ...poseAt(circle, turned), title: `phase of ${name}`, label: `Phase of ${name}, ${phase}°` });
  }
  return [...bodies, ...own];
}

/** The corners of a polygon that is selected, as grips. @returns {Grip[]} */
function cornersOf(scenario, selected, place) {
  const polygon = polygonAt(scenario, selected);
  return (polygon?.corners ?? []).map(([x, y], k) => {
    const title = `corner ${k + 1} of ${nameOf(polygon)}`;
    return { kind: "corner", k, x, y, polygon, title, label: `${title[0].toUpperCase()}${title.slice(1)} at ${place({ x, y })}` };
  });
}

/** What a polygon is called: there is one area. */
export function nameOf({ kind, k }) {
  return kind === "area" ? kind : `${kind} ${k + 1}`;
}

/** Return the scenario without a corner; the last three stay. */
export function withoutCorner(scenario, { k, polygon: { kind, k: number, corners } }) {
  return corners.length > 3 ? withPolygon(scenario, kind, corners.toSpliced(k, 1), number) : scenario;
}

/** What moving a grip to (x, y) makes of a scenario, and of the phases of its plan where they change.
 * @returns {{scenario: any, phase?: {k: number, phase_rad: number}}} */
export function movedTo(scenario, plan, { kind, k, polygon }, { x, y }, turned) {
  if (polygon) return { scenario: withPolygon(scenario, polygon.kind, polygon.corners.with(k, [x, y]), polygon.k) };
  if (kind in BODIES) return { scenario: BODIES[kind].moved(scenario, k, x, y) };
  const circle = circlesOf(scenario, plan)[k];
  const [east, north] = [x - circle.x, y - circle.y];
  if (kind === "radius") return { scenario: withRadius(scenario, k, Math.max(rounded(Math.hypot(east, north), 3), LEAST_RADIUS_M)) };
  const phase = Math.atan2(north, east) - circle.sense * turned;
  return { scenario, phase: { k, phase_rad: ((phase % TURN) + TURN) % TURN } };
}

function degrees(angle) {
  return Math.round((((angle % TURN) + TURN) % TURN) * (360 / TURN));
}
