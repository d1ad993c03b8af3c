// What the map draws, in metres: the marks of a scenario and its plan, at a moment of the period.

import { edges, placeAt, toEdges, TURN, withinReach } from "./geometry.js";
import { landmarksOf, namesOf, polygonsOf, vehiclesOf } from "./scenario.js";

/** @typedef {import("./geometry.js").Circle} Circle */
/** @typedef {{name: string, x: number, y: number, radius: number, sensor: any, off: boolean, blind: boolean} & Circle} Flown */

const DEGREE = TURN / 360;
const SEGMENTS = 360;
/** Directions in rad that a name may lie in, the usual ones first. */
const AROUND = [2, 1, 3, 0, 4, -1, -3, -2].map((eighths) => (eighths * TURN) / 8);
/** Findings of circles that cross edges of polygons, and the kind of these. */
const CROSSINGS = { "outside-area": "area", "in-keep-out": "keep-out" };
const TINY = 1e-9;

/** The circles of a scenario, with the phases of its plan; a vehicle that no plan has starts at 0. `off` names what is
 * switched off: vehicles, and sensors as "sensor:v3".
 * @returns {Flown[]} */
export function circlesOf(scenario, plan, off = []) {
  const planned = new Map((plan?.vehicles ?? []).map((one) => [one.name, one]));
  return vehiclesOf(scenario, plan).map((one) => ({
    ...one,
    phase: planned.get(one.name)?.phase_rad ?? 0,
    sense: one.direction === "cw" ? -1 : 1,
    off: off.includes(one.name),
    blind: off.includes(`sensor:${one.name}`),
  }));
}

/** Circles that keep the phases of those drawn, where these place a vehicle within so many m. */
export function settled(circles, drawn, most) {
  return circles.map((circle, k) => {
    const { name, phase } = drawn[k] ?? {};
    return name === circle.name && Math.abs(2 * circle.radius * Math.sin((phase - circle.phase) / 2)) < most ? { ...circle, phase } : circle;
  });
}

/** Landmarks as circles without a radius. */
export function pointsOf(scenario, off = []) {
  return landmarksOf(scenario).map((one) => ({ ...one, radius: 0, phase: 0, sense: 1, off: off.includes(one.name) }));
}

/** Links that a plan lists, with what became of each: `rank` 1 to 3, or 0 for one that never meets.
 *
 * Whether two still come within reach is seen from the circles, so that a drag shows at once what it
 * breaks; ranks are the plan's. A link is `off` where what is switched off leaves nothing that sees along it. */
export function linksOf(plan, circles, points) {
  if (!plan) return [];
  const bodies = new Map([...circles, ...points].map((body) => [body.name, body]));
  const listed = [
    ...plan.links.map(({ a, b, rank }) => ({ a, b, rank })),
    ...plan.dropped_links.map(({ a, b }) => ({ a, b, rank: 0 })),
    ...plan.landmark_links.map(({ vehicle, landmark, rank }) => ({ a: vehicle, b: landmark, rank })),
  ];
  return listed
    .map((one) => ({ ...one, from: bodies.get(one.a), to: bodies.get(one.b) }))
    .filter(({ from, to }) => from && to)
    .map((one) => {
      const reach = Math.max(reachOf(one.from), reachOf(one.to));
      const isOff = one.from.off || one.to.off || reach === 0;
      const arcs = isOff ? [] : meetings(one.from, one.to, reach);
      return { ...one, arcs, off: isOff, rank: arcs.length || isOff ? one.rank : 0 };
    });
}

/** Meetings that were found already: a drag moves one circle of many. */
const found = new Map();
const MOST_FOUND = 5000;

function meetings(a, b, reach) {
  const key = [a, b].map(({ x, y, radius, phase, sense }) => `${x} ${y} ${radius} ${phase} ${sense}`).join() + reach;
  if (found.size > MOST_FOUND) found.clear();
  if (!found.has(key)) found.set(key, withinReach(a, b, reach));
  return found.get(key);
}

/** The longest range of what a body sees with; a landmark sees nothing. */
function reachOf(body) {
  return body.blind ? 0 : (body.sensor?.range_m ?? 0);
}

/** Points [x, y] of the part of a circle flown between two angles turned. */
export function arcOf(circle, from, to) {
  const steps = Math.max(2, Math.ceil((SEGMENTS * (to - from)) / TURN));
  return Array.from({ length: steps + 1 }, (_, k) => {
    const { x, y } = placeAt(circle, from + ((to - from) * k) / steps);
    return [x, y];
  });
}

/** What breaks a rule of a plan: the names of vehicles and landmarks, and the edges [[x, y], [x, y]] that circles cross. */
export function brokenBy(scenario, plan, circles) {
  const stops = (plan?.verdict?.findings ?? []).filter(({ level, code }) => level === "stop" && code !== "unobservable");
  const crossed = stops.flatMap(({ code, subjects }) =>
    polygonsOf(scenario)
      .filter(({ kind }) => kind === CROSSINGS[code])
      .flatMap(({ corners }) => edges(corners))
      .filter((edge) => circles.some((circle) => subjects.includes(circle.name) && toEdges(edge, circle) < circle.radius)),
  );
  return { names: new Set(stops.flatMap(({ subjects }) => subjects ?? [])), crossed };
}

/** The direction in rad from each body, by name, in which its own name is farthest from its links. */
export function roomAbout(links) {
  /** @type {Map<string, number[]>} */
  const taken = new Map();
  for (const { from, to } of links) {
    const angle = Math.atan2(to.y - from.y, to.x - from.x);
    for (const [{ name }, toward] of [[from, angle], [to, angle + Math.PI]]) taken.set(name, [...(taken.get(name) ?? []), toward]);
  }
  const clear = (angle, others) => Math.min(...others.map((other) => Math.abs(Math.atan2(Math.sin(angle - other), Math.cos(angle - other)))));
  return new Map([...taken].map(([name, others]) => [name, AROUND.reduce((best, angle) => (clear(angle, others) > clear(best, others) + 0.1 ? angle : best))]));
}

/** A scenario on its way from one to another of the same team, by a share: centres and radii between theirs. */
export function between(from, to, share) {
  const before = new Map(vehiclesOf(from).map((vehicle) => [vehicle.name, vehicle]));
  const mixed = vehiclesOf(to).map(({ name, ...end }) => {
    const start = before.get(name) ?? end;
    const [x, y, radius] = ["x", "y", "radius"].map((key) => start[key] + share * (end[key] - start[key]));
    return { center: [x, y], radius };
  });
  return {
    ...to,
    formation: { ...to.formation, centers_m: mixed.map(({ center }) => center) },
    orbit: { ...to.orbit, radius_m: mixed.map(({ radius }) => radius) },
  };
}

/** A body's name, and what of it is switched off. */
export function titleOf({ name, off, blind }) {
  return off ? `${name} (off)` : blind ? `${name} (sensor off)` : name;
}

/** Where a vehicle is after an angle was turned, and its heading in rad. */
export function poseAt(circle, turned) {
  const angle = circle.phase + circle.sense * turned;
  return { ...placeAt(circle, turned), heading: angle + (circle.sense * Math.PI) / 2 };
}

/** Points [x, y] of what a vehicle's sensor covers after an angle was turned, closed. */
export function sightOf(circle, turned) {
  const { x, y, heading } = poseAt(circle, turned);
  const { range_m: range, fov_deg: view, boresight_deg: boresight } = circle.sensor;
  const all = view >= 360;
  const half = (Math.min(view, 360) * DEGREE) / 2;
  const middle = heading + boresight * DEGREE;
  const rim = Array.from({ length: SEGMENTS + 1 }, (_, k) => {
    const angle = middle - half + (2 * half * k) / SEGMENTS;
    return [x + range * Math.cos(angle), y + range * Math.sin(angle)];
  });
  return all ? rim : [[x, y], ...rim, [x, y]];
}

/** Arrows [x, y] of the motions that no sighting shows: shifts of vehicles, and turns about their centres. */
export function motionsOf(scenario, plan) {
  const moved = (plan?.observability.unobservable ?? []).flatMap((one) => one.motion);
  return circlesOf(scenario, plan)
    .flatMap((circle) => moved.filter(({ vehicle }) => vehicle === circle.name).map((one) => ({ circle, ...one })))
    .map(({ circle, shift_m: [x, y], turn_rad: turn }) => {
      const size = Math.hypot(x, y);
      if (size > TINY) {
        const by = circle.radius / size;
        return { path: [[circle.x, circle.y], [circle.x + by * x, circle.y + by * y]], turns: false };
      }
      const inner = { ...circle, radius: 0.6 * circle.radius, phase: Math.PI / 4, sense: Math.sign(turn) };
      return { path: arcOf(inner, 0, 0.75 * TURN), turns: true };
    });
}

/** [west, south, east, north] in m of all that a scenario has. */
export function extentOf(scenario) {
  const reaches = [
    ...vehiclesOf(scenario, null).map(({ x, y, radius }) => [x - radius, y - radius, x + radius, y + radius]),
    ...landmarksOf(scenario).map(({ x, y }) => [x, y, x, y]),
    ...polygonsOf(scenario).flatMap(({ corners }) => corners.map(([x, y]) => [x, y, x, y])),
  ];
  const least = (k) => Math.min(...reaches.map((one) => one[k]));
  const most = (k) => Math.max(...reaches.map((one) => one[k]));
  return namesOf(scenario).length ? [least(0), least(1), most(2), most(3)] : [-100, -100, 100, 100];
}
