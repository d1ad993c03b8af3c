// Reading and changing a scenario as the service resolves it. Every change returns a new scenario.

/** What the direction of all is called, by its value. */
export const DIRECTIONS = { alternate: "neighbours alternate", ccw: "all counter-clockwise", cw: "all clockwise" };

const SAME = 1e-9;
const SAME_LAYER_M = 1e-3;

/** Return a plan's scenario as it is edited here.
 *
 * Centres become a list: objects of JavaScript put names such as "10" in an order of their own. A
 * window of one period is left to follow the period.
 */
export function editable(plan) {
  const scenario = structuredClone(plan.scenario);
  const { formation } = scenario;
  if (!Array.isArray(formation.centers_m)) {
    formation.names = plan.vehicles.map((one) => one.name);
    formation.centers_m = formation.names.map((name) => formation.centers_m[name]);
  }
  if (Math.abs(scenario.window_s - plan.period_s) <= SAME * plan.period_s) delete scenario.window_s;
  return scenario;
}

/** Keys of a scenario on which neither orbits nor meetings depend. */
const LOOSE = ["name", "start_time", "geo_origin", "duration_s", "motion", "initial_sigma", "wind", "filter", "truth", "heading_sigma_rad", "heading_interval_s", "altitude_m", "area_m", "keep_out_m"];
const LOOSE_OF_SENSOR = ["bearing_sigma_rad", "interval_s", "detection_probability", "range_sigma_m", "bearing_bias_sigma_rad", "bearing_walk"];

/** Whether two scenarios say the same. */
export function sameScenario(one, other) {
  return one === other || sorted(one) === sorted(other);
}

/** Whether two scenarios have the same orbits and meetings, whatever else they say. */
export function sameOrbits(one, other) {
  return one === other || sorted(orbitsAndMeetings(one)) === sorted(orbitsAndMeetings(other));
}

/** Return of a plan's vehicles what the service reads of a plan. */
export function orbitsOf({ vehicles }) {
  return vehicles.map(({ name, center_m, radius_m, direction, phase_rad }) => ({ name, center_m, radius_m, direction, phase_rad }));
}

/** Return the orbits of a scenario with the phases of a plan, but one. */
export function withPhase(plan, scenario, { k, phase_rad }) {
  const phases = new Map(plan.vehicles.map((one) => [one.name, one.phase_rad]));
  return vehiclesOf(scenario, plan).map(({ name, x, y, radius, direction }, i) => ({
    name,
    center_m: [x, y],
    radius_m: radius,
    direction,
    phase_rad: i === k ? phase_rad : (phases.get(name) ?? 0),
  }));
}

/** What orbits and meetings depend on, whatever vehicles and landmarks are called. */
function orbitsAndMeetings(scenario) {
  const sensor = [scenario.sensor].flat().map((one) => without(one, LOOSE_OF_SENSOR));
  const { names: _, ...formation } = scenario.formation;
  const names = namesOf(scenario);
  if (formation.links) formation.links = formation.links.map((link) => link.map((name) => names.indexOf(name)));
  return { ...without(scenario, LOOSE), formation, landmarks_m: Object.values(scenario.landmarks_m), sensor };
}

function without(values, keys) {
  return Object.fromEntries(Object.entries(values).filter(([key]) => !keys.includes(key)));
}

/** JSON with the keys of every object in order. */
function sorted(value) {
  return JSON.stringify(value, (_, inner) => {
    if (inner === null || typeof inner !== "object" || Array.isArray(inner)) return inner;
    return Object.fromEntries(Object.entries(inner).sort(([a], [b]) => (a < b ? -1 : 1)));
  });
}

/** Return {name, x, y, radius, direction, sensor} of each vehicle; directions as planned, if known. */
export function vehiclesOf(scenario, plan) {
  const centers = scenario.formation.centers_m;
  const names = namesOf(scenario);
  const turns = plan && plan.vehicles.length === names.length ? plan.vehicles.map((one) => one.direction) : null;
  return centers.map(([x, y], k) => ({
    name: names[k],
    x,
    y,
    radius: each(scenario.orbit.radius_m, k),
    direction: ["ccw", "cw"].find((one) => one === each(scenario.orbit.direction, k)) ?? turns?.[k] ?? "ccw",
    sensor: each(scenario.sensor, k),
    altitude: each(scenario.altitude_m, k),
  }));
}

/** Return {name, x, y} of each landmark. */
export function landmarksOf({ landmarks_m: landmarks }) {
  const nameOf = (key) => (Array.isArray(landmarks) ? `L${Number(key) + 1}` : key);
  return Object.entries(landmarks).map(([key, [x, y]]) => ({ name: nameOf(key), x, y }));
}

export function namesOf(scenario) {
  const { centers_m: centers, names } = scenario.formation;
  return names || centers.map((_, k) => `v${k + 1}`);
}

/** Return the value at a dotted path, undefined where there is none. */
export function valueAt(scenario, path) {
  return path.split(".").reduce((inner, part) => (inner === undefined || inner === null ? undefined : inner[part]), scenario);
}

/** Return the scenario with a value at a path such as "sensor[2].range_m"; undefined takes the key out. What is one value for
 * all vehicles becomes a list of them. */
export function withValue(scenario, path, value) {
  const changed = structuredClone(scenario);
  const parts = path.split(/[.[]/).map((part) => (part.endsWith("]") ? Number.parseInt(part, 10) : part));
  const last = parts.pop();
  let inner = changed;
  for (const [i, part] of parts.entries()) {
    const within = inner[part];
    const listed = typeof (parts[i + 1] ?? last) === "number" && !Array.isArray(within);
    if (listed) inner[part] = namesOf(scenario).map(() => structuredClone(within));
    inner = inner[part] ??= {};
  }
  put(inner, last, value);
  return changed;
}

function put(values, key, value) {
  if (value === undefined) delete values[key];
  else values[key] = value;
}

/** Return the scenario with a value at a path that may be left out; a section left empty goes too. */
export function withOptional(scenario, path, value) {
  const changed = withValue(scenario, path, value);
  const [section, key] = path.split(".");
  if (key && !Object.keys(changed[section]).length) delete changed[section];
  return changed;
}

/** Return the scenario without what is given instead of a path, by pairs of which one is given. */
export function withoutAlternative(scenario, path, pairs) {
  const others = pairs.filter((pair) => pair.includes(path)).flat().filter((one) => one !== path);
  const given = others.filter((one) => valueAt(scenario, one) !== undefined);
  return given.reduce((changed, one) => withValue(changed, one, undefined), scenario);
}

/** Return what a list of sensors, or the one for all, has at `key`; undefined where they differ. */
export function sensorValue(scenario, key) {
  const sensors = [scenario.sensor].flat();
  return sensors.every((one) => one[key] === sensors[0][key]) ? sensors[0][key] : undefined;
}

/** Return the scenario with a key of all sensors changed; undefined takes it out. */
export function withSensor(scenario, key, value) {
  const changed = structuredClone(scenario);
  for (const one of [changed.sensor].flat()) put(one, key, value);
  return changed;
}

/** Return the scenario with vehicle k renamed, in its links too. */
export function withVehicleName(scenario, k, name) {
  const names = namesOf(scenario);
  const changed = withValue(scenario, "formation.names", names.with(k, name));
  const { formation } = changed;
  if (formation.links) formation.links = formation.links.map((link) => link.map((one) => (one === names[k] ? name : one)));
  return changed;
}

/** Return the scenario with landmark k renamed. */
export function withLandmarkName(scenario, k, name) {
  const named = landmarksOf(scenario).map((one, i) => [i === k ? name : one.name, [one.x, one.y]]);
  return withValue(scenario, "landmarks_m", Object.fromEntries(named));
}

export function withCenter(scenario, k, x, y) {
  return withValue(scenario, `formation.centers_m[${k}]`, [x, y]);
}

export function withLandmark(scenario, k, x, y) {
  const { landmarks_m: landmarks } = scenario;
  const moved = { ...landmarks, [Object.keys(landmarks)[k]]: [x, y] };
  return withValue(scenario, "landmarks_m", Array.isArray(landmarks) ? Object.values(moved) : moved);
}

/** Return the scenario with one radius changed. A team that moves at a speed keeps its rate, which is then stated: one speed
 * for all would turn vehicles of different radii at different rates. */
export function withRadius(scenario, k, radius) {
  const { speed_mps: speeds, angular_rate_rad_s: stated, radius_m: radii } = scenario.orbit;
  const rate = stated ?? each(speeds, 0) / each(radii, 0);
  const kept = withValue(withValue(scenario, "orbit.speed_mps", undefined), "orbit.angular_rate_rad_s", rate);
  return withValue(speeds === undefined || speeds === null ? scenario : kept, `orbit.radius_m[${k}]`, radius);
}

/** The altitude of the first vehicle and the step from each vehicle to the next, where altitudes are of that form.
 * @returns {{lowest?: number, step?: number}} */
export function layersOf({ altitude_m: altitude }) {
  const all = [altitude ?? []].flat();
  const step = all.length > 1 ? rounded(all[1] - all[0], 6) : 0;
  return all.every((height, k) => Math.abs(height - all[0] - k * step) < SAME_LAYER_M) ? { lowest: all[0], step } : {};
}

/** Return the scenario with altitudes one step apart; undefined leaves them to the format of an export. */
export function withLayers(scenario, { lowest, step = 0 }) {
  const all = namesOf(scenario).map((_, k) => lowest + k * step);
  return withValue(scenario, "altitude_m", lowest === undefined || step === 0 ? lowest : all);
}

/** Return the scenario with the altitude of one vehicle; others without one fly at the same. */
export function withAltitude(scenario, k, height) {
  const { altitude_m: stated } = scenario;
  return withValue(scenario, "altitude_m", namesOf(scenario).map((_, i) => (i === k ? height : (each(stated, i) ?? height))));
}

/** Return the scenario with the sense of one vehicle set, the others' as planned. */
export function withDirection(scenario, plan, k, direction) {
  return withValue(scenario, "orbit.direction", vehiclesOf(scenario, plan).map((one) => one.direction).with(k, direction));
}

/** What a scenario lists vehicle by vehicle. */
function listsOf({ formation, orbit, sensor, heading_sigma_rad: compass, altitude_m: altitudes }) {
  const { radius_m, direction, desync_rad, speed_mps } = orbit;
  return [formation.centers_m, formation.names, radius_m, direction, desync_rad, speed_mps, sensor, compass, altitudes].filter(Array.isArray);
}

/** Return the scenario with one more vehicle about a centre, like another one: the last where none is named. */
export function withVehicle(scenario, { x, y }, like = -1) {
  const changed = structuredClone(scenario);
  for (const list of listsOf(changed)) list.push(structuredClone(list.at(like)));
  const { centers_m: centers, names } = changed.formation;
  centers.splice(-1, 1, [x, y]);
  names?.splice(-1, 1, free("v", scenario.formation.names));
  return changed;
}

/** Return the scenario without a vehicle, and without its links. */
export function withoutVehicle(scenario, k) {
  const changed = structuredClone(scenario);
  for (const list of listsOf(changed)) list.splice(k, 1);
  const { formation } = changed;
  if (!formation.links) return changed;
  const kept = namesOf(scenario).toSpliced(k, 1);
  const now = namesOf(changed);
  const left = formation.links.filter((link) => link.every((name) => kept.includes(name)));
  formation.links = left.map((link) => link.map((name) => now[kept.indexOf(name)]));
  return changed;
}

/** Return the scenario with these pairs to synchronise; undefined leaves them to reach. */
export function withLinks(scenario, links) {
  return withValue(scenario, "formation.links", links);
}

export function withoutLink(scenario, k) {
  return withLinks(scenario, scenario.formation.links.filter((_, i) => i !== k));
}

/** Return the scenario with a link between two vehicles, or without it if it is listed; what follows reach is listed. */
export function withLinkToggled(scenario, plan, pair) {
  const listed = scenario.formation.links ?? linksPresent(scenario, plan);
  const others = listed.filter((link) => !pair.every((name) => link.includes(name)));
  return withLinks(scenario, others.length < listed.length ? others : [...listed, pair]);
}

/** Return the pairs that a plan has or wanted, of vehicles that are still there. */
export function linksPresent(scenario, plan) {
  const names = namesOf(scenario);
  const pairs = [...plan.links, ...plan.dropped_links].map(({ a, b }) => [a, b]);
  return pairs.filter((pair) => pair.every((name) => names.includes(name)));
}

/** Where each kind of polygon is kept; of an area there is one. */
const POLYGONS = { area: "area_m", "keep-out": "keep_out_m", obstacle: "obstacles_m" };

/** Return the polygons of a scenario, `{ kind, k, key, corners }`. */
export function polygonsOf(scenario) {
  return Object.entries(POLYGONS).flatMap(([kind, key]) => {
    const all = kind === "area" ? [scenario[key] ?? []] : (scenario[key] ?? []);
    return all.map((corners, k) => ({ kind, k, key, corners })).filter(({ corners }) => corners.length);
  });
}

/** Return the polygon of a kind and number, undefined where there is none. */
export function polygonAt(scenario, which) {
  return polygonsOf(scenario).find(({ kind, k }) => kind === which?.kind && k === which.k);
}

/** Return the scenario with the corners of polygon k of a kind, one more where none is k; null takes it out. */
export function withPolygon(scenario, kind, corners, k = Infinity) {
  const key = POLYGONS[kind];
  if (kind === "area") return withValue(scenario, key, corners ?? undefined);
  const all = scenario[key] ?? [];
  const changed = [...all.slice(0, k), ...(corners ? [corners] : []), ...all.slice(k + 1)];
  return withValue(scenario, key, changed.length ? changed : undefined);
}

/** Return the scenario with one more landmark. */
export function addLandmark(scenario, { x, y }) {
  const changed = structuredClone(scenario);
  const { landmarks_m: landmarks } = changed;
  if (Array.isArray(landmarks)) landmarks.push([x, y]);
  else landmarks[free("L", Object.keys(landmarks))] = [x, y];
  return changed;
}

export function withoutLandmark(scenario, k) {
  const changed = structuredClone(scenario);
  const { landmarks_m: landmarks } = changed;
  if (Array.isArray(landmarks)) landmarks.splice(k, 1);
  else delete landmarks[Object.keys(landmarks)[k]];
  return changed;
}

/** Return the power of ten at or below a length. */
export function decade(length) {
  return 10 ** Math.floor(Math.log10(length));
}

/** Return the largest of 1, 2 and 5 times a power of ten that is not above a value. */
export function roundBelow(value) {
  return Math.max(...[1, 2, 5].map((one) => one * decade(value)).filter((one) => one <= value));
}

/** Return the mean of some numbers. */
export function mean(values) {
  return values.reduce((sum, one) => sum + one, 0) / values.length;
}

/** Return what words a place: with as many decimals as tell places of the team apart, wherever it is.
 * @returns {(place: {x: number, y: number}) => string} */
export function placesIn(scenario) {
  const all = vehiclesOf(scenario);
  const spans = ["x", "y"].map((axis) => Math.max(...all.map((one) => one[axis])) - Math.min(...all.map((one) => one[axis])));
  const extent = Math.max(...spans) + 2 * Math.max(...all.map((one) => one.radius));
  const decimals = Math.max(0, 3 - Math.floor(Math.log10(extent)));
  const word = (value) => (Math.abs(value) < 10 ** (4 - decimals) ? rounded(value, 4) : Number(value.toFixed(decimals)));
  return ({ x, y }) => `${word(x)}, ${word(y)} m`;
}

/** Return a number rounded to so many digits, as people would type it. */
export function rounded(value, digits) {
  return Number(value.toPrecision(digits));
}

export function round(value) {
  return Math.round(value * 1e4) / 1e4;
}

function each(value, k) {
  return Array.isArray(value) ? value[k] : value;
}

function free(letter, taken) {
  let number = taken.length + 1;
  while (taken.includes(`${letter}${number}`)) number += 1;
  return `${letter}${number}`;
}
