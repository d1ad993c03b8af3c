// The scenario as a form: every field has a path, and a fault is told next to its field.

import { byId, element, mark } from "./elements.js";
import {
  addLandmark,
  landmarksOf,
  sensorValue,
  valueAt,
  vehiclesOf,
  withCenter,
  withDirection,
  withLandmark,
  withRadius,
  withSensor,
  withValue,
  withVehicle,
  withoutLandmark,
  withoutVehicle,
} from "./scenario.js";

const TEAM = [
  { path: "name", label: "Name", kind: "text" },
  { path: "orbit.angular_rate_rad_s", label: "Angular rate", unit: "rad/s", min: 0 },
  { path: "orbit.speed_mps", label: "Speed", unit: "m/s", min: 0 },
  { path: "orbit.radius_m", label: "Radius of all", unit: "m", min: 0 },
  { path: "orbit.direction", label: "Turn", kind: "choice" },
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
  { path: "motion.turn_rate_sigma_rad_s", label: "Turn rate sigma", unit: "rad/s", min: 0 },
  { path: "initial_sigma.position_m", label: "First position sigma", unit: "m", min: 0 },
  { path: "initial_sigma.heading_rad", label: "First heading sigma", unit: "rad", min: 0 },
];
const PLACE = [
  { path: "geo_origin.lat_deg", label: "Latitude of the origin", unit: "°" },
  { path: "geo_origin.lon_deg", label: "Longitude of the origin", unit: "°" },
  { path: "geo_origin.alt_m", label: "Altitude of the origin", unit: "m" },
  { path: "start_time", label: "Start (RFC 3339)", kind: "text" },
];
const TURNS = { alternate: "neighbours alternate", ccw: "all counter-clockwise", cw: "all clockwise" };

/** The form of a store's scenario. */
export class Editor {
  #store;
  #form = byId("editor");
  #chosen = element("fieldset", { class: "group" });
  #inputs = new Map();
  #shape = "";
  #rated = true;

  constructor(store) {
    this.#store = store;
    this.#form.addEventListener("submit", (event) => event.preventDefault());
    store.addEventListener("opened", () => this.#build());
    store.addEventListener("scenario", () => this.#show());
    store.addEventListener("plan", () => this.#show());
    store.addEventListener("plan", () => this.#clear());
    store.addEventListener("selected", () => this.#chooseBody());
    store.addEventListener("faults", (event) => this.#tell(event.detail));
  }

  #build() {
    this.#inputs.clear();
    this.#shape = "";
    this.#rated = this.#store.scenario.orbit.speed_mps === undefined;
    const rest = element("p", { class: "fault block", role: "alert", id: "fault-rest" });
    this.#form.replaceChildren(
      rest,
      this.#group("Team", TEAM),
      this.#chosen,
      this.#group("Sensors of all", SENSOR),
      this.#folded("Noise", NOISE),
      this.#folded("Place and time, for exports", PLACE),
    );
    this.#show();
  }

  #group(title, fields) {
    const group = element("fieldset", { class: "group" }, element("legend", {}, title));
    const { orbit } = this.#store.scenario;
    for (const field of fields) {
      if (field.path === "orbit.speed_mps" && orbit.speed_mps === undefined) continue;
      if (field.path === "orbit.angular_rate_rad_s" && orbit.angular_rate_rad_s === undefined) continue;
      group.append(this.#field(field, (value) => this.#set(field, value)));
    }
    return group;
  }

  #folded(title, fields) {
    return element("details", {}, element("summary", {}, title), this.#group(title, fields));
  }

  /** A label, its input and the place where its fault is told. */
  #field({ path, label, unit, kind, min, key }, changed) {
    const id = `field-${(key || path).replaceAll(/[^a-z0-9]+/gi, "-")}`;
    const input = kind === "choice" ? element("select", {}) : element("input", typed(kind, min));
    input.id = id;
    input.setAttribute("aria-describedby", `${id}-fault`);
    input.addEventListener(kind === "choice" ? "change" : "input", () => {
      const value = read(input, kind);
      if (value !== null) changed(value);
    });
    this.#inputs.set(key || path, { input, kind, path });
    return element(
      "div",
      { class: kind ? "field wide" : "field" },
      element("label", { for: id }, label, unit ? element("span", { class: "unit" }, ` (${unit})`) : null),
      input,
      element("p", { class: "fault", id: `${id}-fault` }),
    );
  }

  #set({ path }, value) {
    const { scenario } = this.#store;
    const [section, key] = path.split(".");
    let changed;
    if (section === "sensor") changed = withSensor(scenario, key, value);
    else changed = withValue(scenario, path, value === "" ? undefined : value);
    if (section === "geo_origin") changed = wholeOrigin(changed);
    this.#store.edit(changed, { live: true, field: path });
  }

  #show() {
    const { scenario, plan } = this.#store;
    if (!scenario) return;
    const rated = scenario.orbit.speed_mps === undefined;
    if (rated !== this.#rated) {
      this.#build();
      return;
    }
    const shape = `${vehiclesOf(scenario).length} ${landmarksOf(scenario).length}`;
    if (shape !== this.#shape) {
      this.#shape = shape;
      this.#chooseBody();
    }
    for (const [path, { input, kind }] of this.#inputs) {
      if (path.startsWith("chosen.")) continue;
      const [section, key] = path.split(".");
      const value = section === "sensor" ? sensorValue(scenario, key) : valueAt(scenario, path);
      if (kind === "choice") this.#showTurns(input, value);
      else put(input, value);
    }
    this.#showChosen(plan);
  }

  #showTurns(input, value) {
    const given = Array.isArray(value);
    const choices = given ? { ...TURNS, "": "vehicle by vehicle" } : TURNS;
    input.replaceChildren(...Object.entries(choices).map(([one, text]) => element("option", { value: one }, text)));
    input.value = given ? "" : value;
  }

  // --- the vehicle or landmark that was chosen ---------------------------------------------------

  #chooseBody() {
    const { scenario, selected } = this.#store;
    if (!scenario) return;
    for (const path of [...this.#inputs.keys()]) if (path.startsWith("chosen.")) this.#inputs.delete(path);
    const vehicles = vehiclesOf(scenario).map((one, k) => [`vehicle ${k}`, one.name]);
    const landmarks = landmarksOf(scenario).map((one, k) => [`landmark ${k}`, one.name]);
    const picker = element(
      "select",
      { id: "chosen", "aria-label": "Vehicle or landmark", onchange: () => this.#pick(picker.value) },
      element("option", { value: "" }, "choose, here or on the map …"),
      ...[...vehicles, ...landmarks].map(([value, name]) => element("option", { value }, name)),
    );
    const known = selected && selected.k < (selected.kind === "vehicle" ? vehicles : landmarks).length;
    picker.value = known ? `${selected.kind} ${selected.k}` : "";
    this.#chosen.replaceChildren(
      element("legend", {}, "One of them"),
      element("div", { class: "field wide" }, element("label", { for: "chosen" }, "Vehicle or landmark"), picker),
      ...(known ? this.#fieldsOf(selected) : []),
      element(
        "div",
        { class: "row" },
        element("button", { type: "button", onclick: () => this.#grow(withVehicle) }, "Add vehicle"),
        element("button", { type: "button", onclick: () => this.#grow(addLandmark) }, "Add landmark"),
        known && (selected.kind === "landmark" || vehicles.length > 1)
          ? element("button", { type: "button", onclick: () => this.#remove(selected) }, "Remove")
          : null,
      ),
    );
    this.#showChosen(this.#store.plan);
  }

  #pick(value) {
    const [kind, k] = value.split(" ");
    this.#store.select(value ? { kind, k: Number(k) } : null);
    byId("chosen").focus();
  }

  #fieldsOf({ kind, k }) {
    let field = "";
    const edit = (change) => this.#store.edit(change(this.#store.scenario), { live: true, field });
    const made = (key, path, label, unit, more, changed) =>
      this.#field({ key: `chosen.${key}`, path, label, unit, ...more }, (value) => {
        field = path;
        // one that is being typed anew is empty for a moment
        if (value !== "") changed(value);
      });
    if (kind === "landmark") {
      const at = () => landmarksOf(this.#store.scenario)[k];
      const landmarks = this.#store.scenario.landmarks_m;
      const path = Array.isArray(landmarks) ? `landmarks_m[${k}]` : `landmarks_m.${at().name}`;
      return [
        made("x", `${path}[0]`, "East", "m", {}, (x) => edit((old) => withLandmark(old, k, x, at().y))),
        made("y", `${path}[1]`, "North", "m", {}, (y) => edit((old) => withLandmark(old, k, at().x, y))),
      ];
    }
    const at = () => vehiclesOf(this.#store.scenario)[k];
    const path = `formation.centers_m[${k}]`;
    return [
      made("x", `${path}[0]`, "Centre east", "m", {}, (x) => edit((old) => withCenter(old, k, x, at().y))),
      made("y", `${path}[1]`, "Centre north", "m", {}, (y) => edit((old) => withCenter(old, k, at().x, y))),
      made("radius", `orbit.radius_m[${k}]`, "Radius", "m", { min: 0 }, (radius) => edit((old) => withRadius(old, k, radius))),
      made("direction", `orbit.direction[${k}]`, "Turns", "", { kind: "choice" }, (turn) =>
        edit((old) => withDirection(old, this.#store.plan, k, turn)),
      ),
      made("range_m", `sensor[${k}].range_m`, "Its range", "m", { min: 0 }, (value) => edit((old) => withSensor(old, "range_m", value, k))),
      made("fov_deg", `sensor[${k}].fov_deg`, "Its field of view", "°", { min: 0 }, (value) =>
        edit((old) => withSensor(old, "fov_deg", value, k)),
      ),
      made("boresight_deg", `sensor[${k}].boresight_deg`, "Its boresight", "°", {}, (value) =>
        edit((old) => withSensor(old, "boresight_deg", value, k)),
      ),
    ];
  }

  #showChosen(plan) {
    const { scenario, selected } = this.#store;
    if (!selected) return;
    const body = (selected.kind === "vehicle" ? vehiclesOf(scenario, plan) : landmarksOf(scenario))[selected.k];
    if (!body) return;
    const values = { ...body, ...body.sensor };
    for (const [path, { input, kind }] of this.#inputs) {
      if (!path.startsWith("chosen.")) continue;
      const value = values[path.slice("chosen.".length)];
      if (kind === "choice") {
        if (!input.options.length) {
          input.append(element("option", { value: "ccw" }, "counter-clockwise"), element("option", { value: "cw" }, "clockwise"));
        }
        input.value = value;
      } else put(input, value);
    }
  }

  #grow(change) {
    this.#store.edit(change(this.#store.scenario));
    byId("chosen").focus();
  }

  #remove({ kind, k }) {
    this.#store.select(null);
    this.#store.edit((kind === "vehicle" ? withoutVehicle : withoutLandmark)(this.#store.scenario, k));
    byId("chosen").focus();
  }

  // --- faults ------------------------------------------------------------------------------------

  #clear() {
    for (const { input } of this.#inputs.values()) mark(input, "");
    byId("fault-rest").textContent = "";
  }

  #tell({ faults, message }) {
    this.#clear();
    const rest = [];
    for (const { path, message: text } of faults) {
      const place = this.#placeOf(path);
      if (place) mark(place, text);
      else rest.push(path ? `${path}: ${text}` : text);
    }
    byId("fault-rest").textContent = rest.length ? rest.join("; ") : faults.length ? "" : message;
  }

  /** The input of a fault's path: its own, that of the vehicle on show, or that of the whole team. */
  #placeOf(path) {
    const entries = [...this.#inputs.values()];
    const own = entries.find((one) => one.path === path) || entries.find((one) => one.path.startsWith(`${path}[`));
    return (own || entries.find((one) => one.path === path.replaceAll(/\[\d+\]/g, "")))?.input;
  }
}

function typed(kind, min) {
  return kind === "text" ? { type: "text" } : { type: "number", step: "any", min };
}

/** The value of an input; null while a number is half typed, "" where it was emptied. */
function read(input, kind) {
  if (kind) return input.value;
  if (input.value === "") return input.validity.badInput ? null : "";
  return input.valueAsNumber;
}

/** Show a value, unless it is what people are typing just now. */
function put(input, value) {
  if (document.activeElement === input) return;
  const text = value === undefined || value === null ? "" : Array.isArray(value) ? "" : String(value);
  if (input.value !== text) input.value = text;
  input.placeholder = Array.isArray(value) ? "differs" : "";
}

/** An origin with latitude and longitude has an altitude; one without either is none. */
function wholeOrigin(scenario) {
  const origin = scenario.geo_origin || {};
  if (origin.lat_deg === undefined && origin.lon_deg === undefined) return withValue(scenario, "geo_origin", undefined);
  return origin.alt_m === undefined ? withValue(scenario, "geo_origin.alt_m", 0) : scenario;
}
