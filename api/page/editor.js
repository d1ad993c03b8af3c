// The scenario as a form: every field has a path, and a fault is shown next to its field.

import { Body } from "./body.js";
import { byId, element, mark } from "./elements.js";
import { Fields } from "./fields.js";
import { Links } from "./links.js";
import { DIRECTIONS, sensorValue, valueAt, withOptional, withoutAlternative, withSensor, withValue } from "./scenario.js";
import { ALTERNATIVES, MEANINGS } from "./tables.js";
import { WORLD, estimatesOf, isUsed } from "./world.js";

const TEAM = [
  { path: "name", label: "Name", kind: "text" },
  { path: "orbit.angular_rate_rad_s", label: "Angular rate", unit: "rad/s", min: 0 },
  { path: "orbit.speed_mps", label: "Speed", unit: "m/s", min: 0 },
  { path: "orbit.radius_m", label: "Radius of all", unit: "m", min: 0 },
  { path: "orbit.direction", label: "Direction", kind: "choice" },
  { path: "orbit.desync_rad", label: "Desynchronise by", unit: "rad" },
  { path: "min_separation_m", label: "Least separation", unit: "m", min: 0 },
  { path: "duration_s", label: "Duration", unit: "s", min: 0 },
];
const SENSOR = [
  { path: "sensor.range_m", label: "Range", unit: "m", min: 0 },
  { path: "sensor.fov_deg", label: "Field of view", unit: "°", min: 0 },
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
  { path: "geo_origin.lat_deg", label: "Latitude of the origin", unit: "°" },
  { path: "geo_origin.lon_deg", label: "Longitude of the origin", unit: "°" },
  { path: "geo_origin.alt_m", label: "Altitude of the origin", unit: "m" },
  { path: "start_time", label: "Start (RFC 3339)", kind: "text" },
];
const RATES = ["orbit.angular_rate_rad_s", "orbit.speed_mps"];

/** The form of a store's scenario. `storePlan()` resolves with the identifier of the plan on show. */
export class Editor {
  #store;
  #form = byId("editor");
  #fields = new Fields();
  #body;
  #links;
  #rated = true;
  /** the place of the origin as typed: half of one is not yet the scenario's
   * @type {any} */
  #origin = {};
  /** fields that the world adds, whether they were used: a group opens when it begins to be */
  #world = new Map();

  constructor(store, storePlan) {
    this.#store = store;
    this.#body = new Body(store, storePlan);
    this.#links = new Links(store);
    this.#form.addEventListener("submit", (event) => event.preventDefault());
    store.on(["opened"], () => {
      this.#origin = {};
      this.#build();
    });
    store.on(["scenario"], () => this.#show());
    store.on(["plan"], () => this.#show());
    store.on(["plan"], () => this.#clear());
    store.on(["faults"], (detail) => this.#showFaults(detail));
  }

  #build() {
    this.#fields.clear();
    this.#rated = this.#store.scenario.orbit.speed_mps === undefined;
    this.#form.replaceChildren(
      element("p", { class: "fault block", role: "alert", id: "fault-rest" }),
      this.#group("Team", TEAM),
      this.#body.group,
      this.#links.group,
      this.#group("All sensors", SENSOR),
      this.#folded("Noise", NOISE),
      ...this.#worldGroups(),
      this.#folded("Place and time, for exports", PLACE),
    );
    this.#show();
  }

  #group(title, fields) {
    const { orbit } = this.#store.scenario;
    // of rate and speed, the one that is given
    const given = fields.filter(({ path }) => !RATES.includes(path) || valueAt({ orbit }, path) !== undefined);
    const made = given.map((field) => this.#fields.add({ ...field, help: MEANINGS[field.path] }, (value) => this.#set(field, value)));
    return element("fieldset", { class: "group" }, element("legend", {}, title), ...made);
  }

  #worldGroups() {
    this.#world.clear();
    return Object.entries(WORLD).map(([title, fields]) => {
      const group = this.#folded(title, fields.map((one) => ({ ...one, optional: true })));
      this.#world.set(group, { fields, used: false });
      return group;
    });
  }

  #openUsed(scenario) {
    for (const [group, one] of this.#world) {
      const used = isUsed(scenario, one.fields);
      if (used && !one.used) group.open = true;
      one.used = used;
    }
  }

  #folded(title, fields) {
    return element("details", {}, element("summary", {}, title), this.#group(title, fields));
  }

  #set({ path, optional }, value) {
    const { scenario: before } = this.#store;
    const scenario = value === "" ? before : withoutAlternative(before, path, ALTERNATIVES);
    const [section, key] = path.split(".");
    const given = optional && value === "" ? undefined : value;
    let changed;
    if (section === "sensor") changed = withSensor(scenario, key, given);
    else if (optional) changed = withOptional(scenario, path, given);
    else if (section === "geo_origin") changed = this.#withOrigin(key, value);
    else changed = withValue(scenario, path, value === "" ? undefined : value);
    if (changed !== before) this.#store.edit(changed, { live: true, field: path });
  }

  /** The scenario with a part of its origin typed: with both latitude and longitude, it has one. */
  #withOrigin(key, value) {
    const { scenario } = this.#store;
    this.#origin = { ...this.#origin, [key]: value === "" ? undefined : value };
    if (isWhole(this.#origin)) return withValue(scenario, "geo_origin", { alt_m: 0, ...defined(this.#origin) });
    return scenario.geo_origin ? withValue(scenario, "geo_origin", undefined) : scenario;
  }

  #show() {
    const { scenario } = this.#store;
    if (!scenario) return;
    if (scenario.geo_origin) this.#origin = { ...scenario.geo_origin };
    else if (isWhole(this.#origin)) this.#origin = {};
    if ((scenario.orbit.speed_mps === undefined) !== this.#rated) {
      this.#build();
      return;
    }
    for (const path of this.#fields.keys) {
      const [section, key] = path.split(".");
      const value = section === "sensor" ? sensorValue(scenario, key) : valueAt({ ...scenario, geo_origin: this.#origin }, path);
      if (path === "filter.estimate") this.#fields.choose(path, ...estimatesOf(value));
      else if (path !== "orbit.direction") this.#fields.put(path, value);
      else if (Array.isArray(value)) this.#fields.choose(path, { ...DIRECTIONS, "": "vehicle by vehicle" }, "");
      else this.#fields.choose(path, DIRECTIONS, value);
    }
    this.#openUsed(scenario);
    this.#body.show();
    this.#links.show();
  }

  #clear() {
    this.#fields.unmark();
    this.#body.fields.unmark();
    this.#links.showFaults([]);
    byId("fault-rest").textContent = "";
  }

  #showFaults({ faults, message }) {
    this.#fields.unmark();
    this.#body.fields.unmark();
    const rest = [];
    for (const { path, message: text } of this.#links.showFaults(faults)) {
      const place = this.#placeOf(path);
      if (place) mark(place, text);
      else rest.push(path ? `${path}: ${text}` : text);
    }
    byId("fault-rest").textContent = rest.length ? rest.join("; ") : faults.length ? "" : message;
  }

  /** The input of a fault's path: its own, that of a part of it, or that of the whole team. */
  #placeOf(path) {
    const ofTeam = path.replaceAll(/\[\d+\]/g, "");
    const tests = [(one) => one === path, (one) => one.startsWith(`${path}[`), (one) => one === ofTeam];
    for (const test of tests) {
      const found = this.#fields.find(test) || this.#body.fields.find(test);
      if (found) return found;
    }
    return null;
  }
}

function isWhole({ lat_deg: latitude, lon_deg: longitude }) {
  return latitude !== undefined && longitude !== undefined;
}

function defined(values) {
  return Object.fromEntries(Object.entries(values).filter(([, value]) => value !== undefined));
}
