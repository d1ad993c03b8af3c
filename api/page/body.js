// The vehicle or landmark that was chosen: its own part of the form, and how one comes or goes.

import { attempt, byId, element, notice, shown } from "./elements.js";
import { Fields } from "./fields.js";
import { freeCenter, freeSite } from "./free_space.js";
import {
  landmarksOf,
  polygonsOf,
  roundBelow,
  vehiclesOf,
  withCenter,
  withDirection,
  withLandmark,
  withRadius,
  withSensor,
} from "./scenario.js";
import { switchOf } from "./losses.js";
import { addBody, BODIES, copyChosen, placesOf, removeChosen, withAligned, withoutChosen } from "./selection.js";
import { number } from "./requests.js";
import { askJson } from "./service.js";

const TURNS = { ccw: "counter-clockwise", cw: "clockwise" };
const CHOICE = { kind: "choice", choices: (value) => [TURNS, value] };
const AT_LEAST_0 = { min: 0 };

/** Where there is room for one more of a kind, and what lacks room. */
const GROWTH = {
  vehicle: { place: freeCenter, noRoom: "for another circle of the last one's size" },
  landmark: { place: freeSite, noRoom: "for another landmark" },
};

/** The part of the form for one vehicle or landmark of a store's scenario. */
export class Body {
  /** the element to put in the form */
  group = element("fieldset", { class: "group" });
  fields;
  #store;
  #storePlan;
  #names = "";

  /** `storePlan()` resolves with the identifier of the plan on show. */
  constructor(store, storePlan) {
    this.#store = store;
    this.#storePlan = storePlan;
    this.fields = new Fields(store);
    store.on(["opened", "selected"], () => this.#build());
  }

  /** Show the scenario: anew where a vehicle or landmark came or went. */
  show() {
    if (namesIn(this.#store.scenario) !== this.#names) this.#build();
    else this.fields.show(this.#store.scenario);
  }

  #build() {
    const { scenario, selected } = this.#store;
    if (!scenario) return;
    this.#names = namesIn(scenario);
    this.fields.clear();
    const vehicles = vehiclesOf(scenario).map((one, k) => [`vehicle ${k}`, one.name]);
    const landmarks = landmarksOf(scenario).map((one, k) => [`landmark ${k}`, one.name]);
    const picker = element(
      "select",
      { id: "chosen", "aria-label": "Vehicle or landmark", onchange: () => this.#pick(picker.value) },
      element("option", { value: "" }, "choose, here or on the map …"),
      ...[...vehicles, ...landmarks].map(([value, name]) => element("option", { value }, name)),
    );
    const polygons = polygonsOf(scenario).map(({ kind, k }) => [`${kind} ${k}`, kind === "area" ? kind : `${kind} ${k + 1}`]);
    const values = [...vehicles, ...landmarks, ...polygons].map(([value]) => value);
    const known = selected && values.includes(`${selected.kind} ${selected.k}`);
    const places = placesOf(scenario, this.#store.chosen);
    picker.append(...polygons.map(([value, name]) => element("option", { value }, name)));
    picker.value = known ? `${selected.kind} ${selected.k}` : "";
    const parts = [
      element("legend", {}, this.#store.chosen.length > 1 ? `${this.#store.chosen.length} selected; last of them` : "Selected vehicle or landmark"),
      element("div", { class: "field wide" }, element("label", { for: "chosen" }, "Vehicle or landmark"), picker),
      ...(known ? this.#fieldsOf(selected) : []),
      element(
        "div",
        { class: "row" },
        element("button", { type: "button", onclick: () => this.#grow("vehicle") }, "Add vehicle"),
        element("button", { type: "button", onclick: () => this.#grow("landmark") }, "Add landmark"),
        places.length ? element("button", { type: "button", onclick: () => this.#do(copyChosen) }, "Copy") : null,
        places.length ? element("button", { type: "button", onclick: () => this.#align() }, "Align to grid") : null,
        known && (selected.kind !== "vehicle" || vehicles.length > 1)
          ? element("button", { type: "button", onclick: () => this.#do(removeChosen) }, "Remove")
          : null,
      ),
      known && selected.kind in BODIES ? element("div", { class: "row" }, ...this.#switches(selected)) : null,
      this.#candidates(),
    ];
    const focused = this.group.contains(document.activeElement) ? document.activeElement?.id : "";
    this.group.replaceChildren(...parts.filter((one) => one !== null));
    if (focused) byId(focused)?.focus();
    this.fields.show(scenario);
  }

  /** Buttons that switch the body off and on, on the map, and a vehicle's sensor. */
  #switches({ kind, k }) {
    const { name } = BODIES[kind].all(this.#store.scenario)[k];
    const parts = kind === "vehicle" ? [name, `sensor:${name}`] : [name];
    return parts.map((one) => switchOf(this.#store, one));
  }

  #fieldsOf({ kind, k }) {
    if (kind === "vehicle") return this.#ofVehicle(k);
    return kind === "landmark" ? this.#ofLandmark(k) : [element("p", { class: "hint" }, "Drag its corners on the map, or a point of an edge for one more; a click with Alt takes a corner out.")];
  }

  #ofVehicle(k) {
    const center = `formation.centers_m[${k}]`;
    const orbit = (key, name, ...rest) => this.#field(key, `orbit.${name}[${k}]`, ...rest);
    const sensor = (key, label, unit, more) =>
      this.#field(key, `sensor[${k}].${key}`, label, unit, (old, value) => withSensor(old, key, value, k), more);
    const at = (scenario) => vehiclesOf(scenario)[k];
    return [
      this.#name(`formation.names[${k}]`),
      this.#field("x", `${center}[0]`, "Centre east", "m", (old, x) => withCenter(old, k, x, at(old).y)),
      this.#field("y", `${center}[1]`, "Centre north", "m", (old, y) => withCenter(old, k, at(old).x, y)),
      orbit("radius", "radius_m", "Radius", "m", (old, radius) => withRadius(old, k, radius), AT_LEAST_0),
      orbit("direction", "direction", "Its direction", "", (old, turn) => withDirection(old, this.#store.plan, k, turn), CHOICE),
      sensor("range_m", "Its range", "m", AT_LEAST_0),
      sensor("fov_deg", "Its field of view", "°", { min: 0, max: 360 }),
      sensor("boresight_deg", "Its boresight", "°"),
    ];
  }

  #ofLandmark(k) {
    const { landmarks_m: landmarks } = this.#store.scenario;
    const at = (scenario) => landmarksOf(scenario)[k];
    const place = Array.isArray(landmarks) ? `landmarks_m[${k}]` : `landmarks_m.${at(this.#store.scenario).name}`;
    return [
      this.#name(place),
      this.#field("x", `${place}[0]`, "East", "m", (old, x) => withLandmark(old, k, x, at(old).y)),
      this.#field("y", `${place}[1]`, "North", "m", (old, y) => withLandmark(old, k, at(old).x, y)),
    ];
  }

  #name(path) {
    const { kind, k } = this.#store.selected;
    const enter = (scenario, name) => {
      const { all, named } = BODIES[kind];
      if (all(scenario).some((one) => one.name === name)) {
        notice(`There is a ${kind} ${name} already.`, { fault: true });
        return scenario;
      }
      return named(scenario, k, name);
    };
    return this.#field("name", path, "Its name", "", enter, { kind: "name" });
  }

  /** A field of the selected body, whose value `enter(scenario, value)` enters. */
  #field(key, path, label, unit, enter, more = {}) {
    const { kind, k } = this.#store.selected;
    const read = (scenario) => {
      const body = BODIES[kind].all(scenario, this.#store.plan)[k];
      return { ...body, ...body?.sensor }[key];
    };
    // one that is being typed anew is empty for a moment
    const change = (scenario, value) => (value === "" ? scenario : enter(scenario, value));
    return this.fields.add({ id: `chosen-${key}`, path, label, unit, read, change, ...more });
  }

  #pick(value) {
    const [kind, k] = value.split(" ");
    this.#store.select(value ? { kind, k: Number(k) } : null);
    byId("chosen").focus();
  }

  /** Put one more where there is room for it, and select it. */
  #grow(kind) {
    const { place, noRoom } = GROWTH[kind];
    const { scenario, given } = this.#store;
    const at = place(scenario);
    if (!at) {
      notice(`There is no room ${noRoom}: move something, or enlarge the area.`, { fault: true });
      return;
    }
    addBody(this.#store, kind, at, { reveal: true });
    // that phases were lost is said already, and matters more
    const { scenario: grown } = this.#store;
    const link = grown.formation.links?.length > scenario.formation.links?.length ? `, with the link ${grown.formation.links.at(-1).join("-")}` : "";
    if (!given) notice(`${BODIES[kind].all(grown).at(-1).name} added at ${shown(at.x)}, ${shown(at.y)} m${link}.`);
    byId("chosen").focus();
  }

  /** What keeps the best of the landmarks that are selected; null where there is nothing to choose. */
  #candidates() {
    const { scenario, chosen } = this.#store;
    const sites = chosen.filter(({ kind, k }) => kind === "landmark" && landmarksOf(scenario)[k]);
    if (sites.length < 2) return null;
    const count = number("best-count", "count", Math.ceil(sites.length / 2), "Landmarks to keep");
    const keep = element("button", { type: "button", onclick: () => attempt(() => this.#keepBest(sites, count.value)) }, "Keep the best");
    return element("div", { class: "row" }, keep, count, `of these ${sites.length} landmarks`);
  }

  /** Remove all of these landmarks but so many, by which the worst vehicle is known best. */
  async #keepBest(sites, count) {
    const { scenario } = this.#store;
    const nameOf = ({ k }) => landmarksOf(scenario)[k].name;
    const asked = new URLSearchParams([["choose", count], ...sites.map((one) => ["candidate", nameOf(one)])]);
    const { chosen, value_m: bound, proven_best: proven } = await askJson("GET", `v1/plans/${await this.#storePlan()}/landmark-choice?${asked}`);
    if (this.#store.scenario !== scenario) return;
    this.#store.select(null);
    this.#store.edit(withoutChosen(scenario, sites.filter((one) => !chosen.includes(nameOf(one)))));
    notice(`Kept ${chosen.join(", ")}: the worst vehicle's window bound is ${shown(bound, "m")}${proven ? ", and no other choice has a smaller one" : ""}.`);
  }

  #do(change) {
    change(this.#store);
    byId("chosen").focus();
  }

  #align() {
    const { scenario, chosen } = this.#store;
    const step = gridOf(scenario);
    this.#store.edit(withAligned(scenario, chosen, step));
    notice(`Aligned to a grid of ${shown(step, "m")}.`);
  }
}

/** The spacing in m of the grid that a selection is aligned to: a round length of about half the mean radius. */
function gridOf(scenario) {
  const radii = vehiclesOf(scenario).map((one) => one.radius);
  return roundBelow(radii.reduce((sum, one) => sum + one, 0) / radii.length / 2);
}

function namesIn(scenario) {
  const named = [vehiclesOf(scenario), landmarksOf(scenario)].map((all) => all.map((one) => one.name));
  return JSON.stringify([...named, polygonsOf(scenario).length]);
}
