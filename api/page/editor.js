// The scenario as a form: every field has a path, and a fault is shown next to its field.

import { bodyPart } from "./body.js";
import { byId, element, folded, mark } from "./elements.js";
import { Fields } from "./fields.js";
import { linksPart } from "./links.js";
import { DIRECTIONS, layersOf, sensorValue, valueAt, withLayers, withOptional, withoutAlternative, withSensor, withValue } from "./scenario.js";
import { ALTERNATIVES, MEANINGS } from "./tables.js";

const TEAM = [
  { path: "name", label: "Name", kind: "text" },
  { path: "orbit.angular_rate_rad_s", label: "Angular rate", unit: "rad/s", min: 0 },
  { path: "orbit.speed_mps", label: "Speed", unit: "m/s", min: 0 },
  { path: "orbit.radius_m", label: "Radius of all", unit: "m", min: 0 },
  { path: "orbit.direction", label: "Direction", kind: "choice", choices: (value) => (Array.isArray(value) ? [{ ...DIRECTIONS, "": "vehicle by vehicle" }, ""] : [DIRECTIONS, value]) },
  { path: "orbit.desync_rad", label: "Desynchronise by", unit: "rad" },
  { path: "min_separation_m", label: "Least separation", unit: "m", min: 0, steady: true },
  { path: "duration_s", label: "Duration", unit: "s", min: 0 },
];
const SENSOR = [
  { path: "sensor.range_m", label: "Range", unit: "m", min: 0 },
  { path: "sensor.fov_deg", label: "Field of view", unit: "°", min: 0, max: 360 },
  { path: "sensor.boresight_deg", label: "Boresight", unit: "°" },
  { path: "sensor.bearing_sigma_rad", label: "Bearing sigma", unit: "rad", min: 0 },
  { path: "sensor.sample_time_s", label: "Sample time", unit: "s", min: 0 },
];
const NOISE = [
  { path: "motion.speed_sigma_mps", label: "Speed sigma", unit: "m/s", min: 0 },
  { path: "motion.turn_rate_sigma_rad_s", label: "Turn-rate sigma", unit: "rad/s", min: 0 },
  { path: "initial_sigma.position_m", label: "Initial position sigma", unit: "m", min: 0 },
  { path: "initial_sigma.heading_rad", label: "Initial heading sigma", unit: "rad", min: 0 },
];
const PLACE = [
  { path: "altitude_m", label: "Altitude above ground", unit: "m", steady: true },
  { path: "altitude_m.step", label: "Altitude step between vehicles", unit: "m", steady: true },
  { path: "geo_origin.lat_deg", label: "Latitude of the origin", unit: "°", steady: true },
  { path: "geo_origin.lon_deg", label: "Longitude of the origin", unit: "°", steady: true },
  { path: "geo_origin.alt_m", label: "Ground above sea level", unit: "m", steady: true },
  { path: "start_time", label: "Start, such as 2026-05-01T09:00:00Z", kind: "text" },
];
/** what a step begins from where no altitude is stated */
const USUAL_ALTITUDE_M = 50;
const RATES = ["orbit.angular_rate_rad_s", "orbit.speed_mps"];

/** What the world adds, folded away where a scenario has none of a group's keys. @type {Record<string, any[]>} */
const WORLD = {
  "Sightings: interval, distance, compass": [
    { path: "sensor.interval_s", label: "Sighting interval", unit: "s", min: 0 },
    { path: "sensor.detection_probability", label: "Detection probability", min: 0, max: 1 },
    { path: "sensor.range_sigma_m", label: "Distance sigma", unit: "m", min: 0 },
    { path: "sensor.bearing_bias_sigma_rad", label: "Bearing bias sigma", unit: "rad", min: 0 },
    { path: "sensor.bearing_walk", label: "Bearing walk", kind: "json" },
    { path: "heading_sigma_rad", label: "Compass sigma", unit: "rad", min: 0 },
    { path: "heading_interval_s", label: "Compass interval", unit: "s", min: 0 },
  ],
  "Errors of motion readings": [
    { path: "motion.position_random_walk_m_sqrt_s", label: "Position random walk", unit: "m/√s", min: 0 },
    { path: "motion.angle_random_walk_rad_sqrt_s", label: "Angle random walk", unit: "rad/√s", min: 0 },
    { path: "motion.speed_scale_sigma", label: "Speed scale sigma", min: 0 },
    { path: "motion.turn_rate_bias_sigma_rad_s", label: "Turn-rate bias sigma", unit: "rad/s", min: 0 },
    { path: "motion.clock_offset_sigma_s", label: "Clock offset sigma", unit: "s", min: 0 },
  ],
  "Wind or current": [
    { path: "wind.sigma_mps", label: "Wind sigma", unit: "m/s", min: 0 },
    { path: "wind.gust_sigma_mps", label: "Gust sigma", unit: "m/s", min: 0 },
    { path: "wind.gust_time_s", label: "Gust time", unit: "s", min: 0 },
  ],
  "A simulated world that differs": [{ path: "truth", label: "Keys that are true instead", kind: "json" }],
  "Errors that the filter estimates": [{ path: "filter.estimate", label: "Estimated errors", kind: "choice", choices: estimatesOf }],
};

const ESTIMATES = { auto: "all with a sigma", none: "none" };

/** Fill in the form of a store's scenario. `storePlan()` resolves with the identifier of the plan on show. */
export function offerEditor(store, storePlan) {
  const form = byId("editor");
  const fields = new Fields(store);
  const body = bodyPart(store, storePlan);
  const links = linksPart(store);
  const all = [fields, body.fields];
  const rest = element("p", { class: "fault block", role: "alert", id: "fault-rest" });
  /** the place of the origin as typed: half of one is not yet the scenario's @type {any} */
  let origin = {};
  /** groups of fields of the world, and whether they were used: a group opens when it begins to be */
  const world = new Map();

  form.addEventListener("submit", (event) => event.preventDefault());
  store.on(["opened"], () => {
    origin = {};
    build();
    byId("findings").closest(".inspector").scrollTop = 0;
  });
  store.on(["scenario", "plan", "degrees"], show);
  store.on(["plan"], () => showFaults({ faults: [], message: "" }));
  store.on(["faults"], showFaults);

  function build() {
    fields.clear();
    world.clear();
    for (const [title, ofWorld] of Object.entries(WORLD)) world.set(folded(title, group(title, ofWorld, true)), { ofWorld, used: false });
    form.replaceChildren(
      rest,
      group("Team", TEAM),
      body.group,
      links.group,
      group("All sensors", SENSOR),
      folded("Noise", group("Noise", NOISE)),
      ...world.keys(),
    );
    byId("preflight-fields").replaceChildren(group("Altitudes, place and time", PLACE));
    show();
  }

  /** A group of fields; those that are optional leave no empty section behind. */
  function group(title, given, optional = false) {
    const made = given.map((field) => fields.add({ ...field, help: MEANINGS[field.path], ...access(field.path, optional) }));
    return element("fieldset", { class: "group" }, element("legend", {}, title), made);
  }

  /** How a field reads and changes a scenario. */
  function access(path, optional) {
    const [section, key] = path.split(".");
    if (section === "altitude_m") return layerField(key);
    const change = (before, value) => {
      const scenario = value === "" ? before : withoutAlternative(before, path, ALTERNATIVES);
      if (section === "sensor") return withSensor(scenario, key, optional && value === "" ? undefined : value);
      if (section === "geo_origin") return withOrigin(scenario, key, value);
      return (optional ? withOptional : withValue)(scenario, path, value === "" ? undefined : value);
    };
    if (section === "sensor") return { change, read: (scenario) => sensorValue(scenario, key) };
    const read = (scenario) => valueAt({ ...scenario, geo_origin: origin }, path);
    return { change, read };
  }

  /** How the fields of altitudes read and change a scenario: the lowest, and the step from vehicle to vehicle. */
  function layerField(key) {
    const typed = (value) => (value === "" ? undefined : value);
    if (key) return { read: (scenario) => layersOf(scenario).step, change: (scenario, step) => withLayers(scenario, { lowest: layersOf(scenario).lowest ?? USUAL_ALTITUDE_M, step: typed(step) }) };
    return { read: (scenario) => layersOf(scenario).lowest ?? scenario.altitude_m, change: (scenario, lowest) => withLayers(scenario, { ...layersOf(scenario), lowest: typed(lowest) }) };
  }

  /** The scenario with a part of its origin typed: with both latitude and longitude, it has one. */
  function withOrigin(scenario, key, value) {
    origin = { ...origin, [key]: value === "" ? undefined : value };
    if (isWhole(origin)) return withValue(scenario, "geo_origin", { ...origin });
    return scenario.geo_origin ? withValue(scenario, "geo_origin", undefined) : scenario;
  }

  function show() {
    const { scenario } = store;
    if (!scenario) return;
    if (scenario.geo_origin) origin = { ...scenario.geo_origin };
    else if (isWhole(origin)) origin = {};
    fields.show(scenario);
    // of rate and speed, the one that is given
    const given = RATES.find((path) => valueAt(scenario, path) !== undefined);
    for (const path of RATES) fields.find((one) => one === path).closest(".field").hidden = given !== undefined && path !== given;
    for (const [folder, one] of world) {
      const used = isUsed(scenario, one.ofWorld);
      if (used && !one.used) folder.open = true;
      one.used = used;
    }
    body.show();
    links.show();
  }

  /** Show each fault at its field, and what has none above them. */
  function showFaults({ faults, message }) {
    for (const one of all) one.unmark();
    const others = [];
    for (const { path, message: text } of links.showFaults(faults)) {
      const place = placeOf(path);
      if (place) mark(place, text);
      else others.push(path ? `${path}: ${text}` : text);
    }
    rest.textContent = faults.length ? others.join("; ") : message;
  }

  /** The input of a fault's path: its own, that of a part of it, or that of the whole team. */
  function placeOf(path) {
    const ofTeam = path.replaceAll(/\[\d+\]/g, "");
    const tests = [(one) => one === path, (one) => one.startsWith(`${path}[`), (one) => one === ofTeam];
    return tests.flatMap((test) => all.map((one) => one.find(test))).find(Boolean);
  }
}

function isWhole({ lat_deg: latitude, lon_deg: longitude }) {
  return latitude !== undefined && longitude !== undefined;
}

/** Whether a scenario has a key of a group; of sensors, any of them. */
function isUsed(scenario, fields) {
  const given = (path) => {
    const [section, key] = path.split(".");
    const places = section === "sensor" ? [scenario.sensor].flat().map((one) => one[key]) : [valueAt(scenario, path)];
    return places.some((value) => value !== undefined && value !== null);
  };
  return fields.some(({ path }) => given(path));
}

/** Return the choices of what the filter estimates, and the one taken: a list stays as it is. */
function estimatesOf(value = "auto") {
  if (Array.isArray(value)) return [{ ...ESTIMATES, "": value.join(", ") || "none listed" }, ""];
  return [ESTIMATES, value === "none" ? "none" : "auto"];
}
