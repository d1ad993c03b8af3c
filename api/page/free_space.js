// Where another circle or landmark finds room: clear of all that is there, and within reach of the team.

import { edges, toEdges, within } from "./geometry.js";
import { decade, landmarksOf, mean, polygonsOf, round, vehiclesOf, withLinks, withVehicle } from "./scenario.js";

/** Share of the mean radius that is kept where the scenario states no distance; the verdict has the same. */
const TOO_NEAR = 0.1;
/** Share by which more is kept than is asked for: coordinates are rounded. */
const SPARE = 0.02;
/** Directions that are tried round each vehicle. */
const DIRECTIONS = 24;
/** Where, between touching and out of reach, places are tried. */
const SHARES = [0.6, 0.3, 0.9];
/** Places of the team's own pattern that are tried from each vehicle. */
const MOST_STEPS = 24;
/** How many times the distance grows by half where nothing near is free. */
const FARTHER = 12;
/** Points along each side of an area's box that are tried last. */
const GRID = 40;

/** Return `{ x, y }`, a centre for another vehicle like the last one, or null where no room is found. */
export function freeCenter(scenario) {
  const vehicles = vehiclesOf(scenario);
  const like = vehicles.at(-1);
  const { clearance, separation } = distances(scenario, vehicles, like.radius);
  const landmarks = landmarksOf(scenario);
  const free = (at) =>
    vehicles.every((one) => away(at, one) >= one.radius + like.radius + separation) &&
    landmarks.every((one) => away(at, one) >= like.radius + clearance) &&
    clearOfPolygons(scenario, at, like.radius * (1 + SPARE));
  const meets = (at) => vehicles.filter((one) => inReach(one, { ...like, ...at }) && sees(scenario, one, at));
  const span = (one) => [one.radius + like.radius + separation, one.radius + like.radius + reachOf(one, like)];
  const pattern = steps(vehicles).flatMap(([x, y]) => vehicles.map((one) => ({ x: one.x + x, y: one.y + y, pattern: true })));
  return chosen([...pattern, ...around(vehicles, span)], { scenario, vehicles, free, meets, span });
}

/** Return `{ x, y }`, a place for another landmark, or null where no room is found. */
export function freeSite(scenario) {
  const vehicles = vehiclesOf(scenario);
  const { clearance, meanRadius } = distances(scenario, vehicles, 0);
  const landmarks = landmarksOf(scenario);
  const free = (at) =>
    vehicles.every((one) => away(at, one) >= one.radius + clearance) &&
    landmarks.every((one) => away(at, one) >= meanRadius) &&
    (scenario.obstacles_m || []).every((one) => !within(one, at));
  const meets = (at) => vehicles.filter((one) => away(at, one) <= one.radius + one.sensor.range_m && sees(scenario, one, at));
  const span = (one) => [one.radius + clearance, one.radius + one.sensor.range_m];
  return chosen(around(vehicles, span), { scenario, vehicles, free, meets, span });
}

/** Return the scenario with one more vehicle; where links are listed, linked to the nearest one. */
export function withMember(scenario, at, like) {
  const changed = withVehicle(scenario, at, like);
  const { links } = changed.formation;
  const all = vehiclesOf(changed);
  const last = all.pop();
  const near = all.filter((one) => inReach(one, last)).sort((a, b) => gapBetween(a, last) - gapBetween(b, last));
  return links && near.length ? withLinks(changed, [...links, [near[0].name, last.name]]) : changed;
}

/** The place in the area, or in a part of the plane, that is farthest from circles, landmarks and polygons: `room` in m.
 * @param {any} extent [west, south, east, north] */
export function roomiest(scenario, extent) {
  const bodies = [...vehiclesOf(scenario), ...landmarksOf(scenario).map((landmark) => ({ ...landmark, radius: 0 }))];
  const room = (at) =>
    Math.min(
      ...bodies.map((body) => away(body, at) - body.radius),
      ...polygonsOf(scenario).map(({ kind, corners }) => (within(corners, at) === (kind === "area") ? toEdges(corners, at) : 0)),
    );
  const places = grid(scenario.area_m ?? [extent.slice(0, 2), extent.slice(2)]).map((at) => ({ ...at, room: room(at) }));
  return places.reduce((best, place) => (place.room > best.room ? place : best));
}

/** Whether the circles of two vehicles come near enough for one to see the other. */
function inReach(one, other) {
  return gapBetween(one, other) <= reachOf(one, other);
}

/** The least distance, in m, at which two vehicles on their circles can meet. */
function gapBetween(one, other) {
  const apart = away(one, other);
  return Math.max(apart - one.radius - other.radius, Math.abs(one.radius - other.radius) - apart, 0);
}

/** The best of the places that are free: the first ones tried, else farther and farther ones. */
function chosen(tried, { scenario, vehicles, free, meets, span }) {
  const middle = { x: mean(vehicles.map((one) => one.x)), y: mean(vehicles.map((one) => one.y)) };
  const odd = vehicles.some((one) => closesTriangle(vehicles.filter((other) => other !== one && inReach(one, other))));
  const rankOf = (at) => rank(at, meets(at), middle, odd);
  const unit = decade(mean(vehicles.map((one) => one.radius)) / 50);
  const best = (places) => {
    const rated = places.map((at) => tidy(at, unit)).filter(free).map((at) => ({ at, rank: rankOf(at) }));
    return rated.length ? rated.reduce((a, b) => (before(a.rank, b.rank) ? a : b)).at : null;
  };
  const found = best(tried);
  if (found && meets(found).length) return found;
  for (let k = 1; k <= FARTHER; k += 1) {
    const place = best(around(vehicles, (one) => span(one).map((distance) => distance * 1.5 ** k)));
    if (found || place) return found || place;
  }
  return best(grid(scenario.area_m || []));
}

/** What makes a place better, first things first.
 *
 * Vehicles to meet; no odd cycle, which has no phases in closed form, unless the team has some; the
 * team's own pattern; more vehicles to meet; nearer to the middle.
 */
function rank(at, met, middle, odd) {
  return [met.length ? 0 : 1, !odd && closesTriangle(met) ? 1 : 0, at.pattern ? 0 : 1, -met.length, away(at, middle)];
}

/** Whether two of the vehicles that one meets meet each other. */
function closesTriangle(met) {
  return met.some((one, i) => met.slice(i + 1).some((other) => inReach(one, other)));
}

function before(one, other) {
  const k = one.findIndex((value, i) => value !== other[i]);
  return k < 0 || one[k] < other[k];
}

/** The steps from a vehicle to one within its reach: a grid goes on as a grid. */
function steps(vehicles) {
  const found = new Map();
  for (const one of vehicles) {
    for (const other of vehicles) {
      if (found.size >= MOST_STEPS) break;
      const step = [round(other.x - one.x), round(other.y - one.y)];
      if (one !== other && inReach(one, other)) found.set(step.join(), step);
    }
  }
  return [...found.values()];
}

/** Places round each vehicle, between two distances from it. */
function around(vehicles, span) {
  return vehicles.flatMap((one) => {
    const [least, most] = span(one);
    return SHARES.flatMap((share) =>
      Array.from({ length: DIRECTIONS }, (_, k) => {
        const distance = least + share * Math.max(most - least, 0);
        const angle = (2 * Math.PI * k) / DIRECTIONS;
        return { x: one.x + distance * Math.cos(angle), y: one.y + distance * Math.sin(angle) };
      }),
    );
  });
}

/** Places all over an area. */
function grid(corners) {
  if (!corners.length) return [];
  const [xs, ys] = [0, 1].map((axis) => corners.map((one) => one[axis]));
  const at = (values, k) => Math.min(...values) + ((Math.max(...values) - Math.min(...values)) * (k + 0.5)) / GRID;
  return Array.from({ length: GRID * GRID }, (_, k) => ({ x: at(xs, k % GRID), y: at(ys, Math.floor(k / GRID)) }));
}

/** What is kept from other circles and from landmarks, in m, with another circle of that radius; 0 for none. */
function distances({ min_separation_m: stated, landmark_clearance_m: clearance }, vehicles, radius) {
  const radii = vehicles.map((one) => one.radius);
  const meanRadius = mean(radius ? [...radii, radius] : radii);
  const least = TOO_NEAR * meanRadius;
  return {
    meanRadius,
    separation: (stated || least) * (1 + SPARE),
    clearance: (clearance ?? least) * (1 + SPARE) + SPARE * meanRadius,
  };
}

/** Whether a circle lies within the area and clear of every keep-out and obstacle. */
function clearOfPolygons({ area_m: area, keep_out_m: kept, obstacles_m: walls }, at, radius) {
  if (area && !(within(area, at) && toEdges(area, at) >= radius)) return false;
  return [...(kept || []), ...(walls || [])].every((one) => !within(one, at) && toEdges(one, at) >= radius);
}

/** Whether no obstacle stands between a circle's centre and a place: the plan knows exactly. */
function sees({ obstacles_m: walls }, one, at) {
  return (walls || []).every((wall) => edges(wall).every(([from, to]) => !cross([one.x, one.y], [at.x, at.y], from, to)));
}

/** Whether the segments from a to b and from c to d cross. */
function cross(a, b, c, d) {
  return side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0;
}

/** On which side of the line from a to b a point is: positive left, negative right. */
function side([ax, ay], [bx, by], [x, y]) {
  return (bx - ax) * (y - ay) - (by - ay) * (x - ax);
}

function reachOf(one, other) {
  return Math.max(one.sensor.range_m, other.sensor.range_m);
}

function away(one, other) {
  return Math.hypot(one.x - other.x, one.y - other.y);
}

/** A place as people would type it; one of the team's pattern stays in it. */
function tidy(at, unit) {
  if (at.pattern) return { ...at, x: round(at.x), y: round(at.y) };
  return { ...at, x: round(Math.round(at.x / unit) * unit), y: round(Math.round(at.y / unit) * unit) };
}
