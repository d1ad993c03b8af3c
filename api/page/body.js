// The vehicle or landmark that was chosen: its own part of the form, and how one comes or goes.

import { attempt, button, byId, element, notice, options, present, shown } from "./elements.js";
import { Fields } from "./fields.js";
import { freeCenter, freeSite } from "./free_space.js";
import { switchOf } from "./losses.js";
import { landmarksOf, mean, placesIn, polygonsOf, roundBelow, vehiclesOf, withDirection, withValue } from "./scenario.js";
import { addBody, BODIES, copyChosen, placesOf, removeChosen, withAligned, withoutChosen } from "./selection.js";
import { askJson } from "./service.js";

const TURNS = { ccw: "counter-clockwise", cw: "clockwise" };

/** Where there is room for one more of a kind, and what lacks room. */
const GROWTH = {
  vehicle: { place: freeCenter, noRoom: "for another circle of the last one's size" },
  landmark: { place: freeSite, noRoom: "for another landmark" },
};

/** The fields of vehicle or landmark k, by its kind. */
const FIELDS = {
  vehicle: (k) => [
    { key: "name", path: `formation.names[${k}]`, label: "Its name", kind: "name" },
    { key: "x", path: `formation.centers_m[${k}][0]`, label: "Centre east", unit: "m" },
    { key: "y", path: `formation.centers_m[${k}][1]`, label: "Centre north", unit: "m" },
    { key: "radius", path: `orbit.radius_m[${k}]`, label: "Radius", unit: "m", min: 0 },
    { key: "direction", path: `orbit.direction[${k}]`, label: "Its direction", kind: "choice", choices: (value) => [TURNS, value] },
    { key: "range_m", path: `sensor[${k}].range_m`, label: "Its range", unit: "m", min: 0 },
    { key: "fov_deg", path: `sensor[${k}].fov_deg`, label: "Its field of view", unit: "°", min: 0, max: 360 },
    { key: "boresight_deg", path: `sensor[${k}].boresight_deg`, label: "Its boresight", unit: "°" },
  ],
  landmark: (k, { landmarks_m: landmarks }) => {
    const place = Array.isArray(landmarks) ? `landmarks_m[${k}]` : `landmarks_m.${Object.keys(landmarks)[k]}`;
    return [
      { key: "name", path: place, label: "Its name", kind: "name" },
      { key: "x", path: `${place}[0]`, label: "East", unit: "m" },
      { key: "y", path: `${place}[1]`, label: "North", unit: "m" },
    ];
  },
};

/** The part of the form for one vehicle or landmark of a store's scenario.
 *
 * `storePlan()` resolves with the identifier of the plan on show. Returns the element to put in the form, its fields, and
 * what shows the scenario.
 */
export function bodyPart(store, storePlan) {
  const group = element("fieldset", { class: "group" });
  const fields = new Fields(store);
  let names = "";
  store.on(["opened", "selected"], build);
  return { group, fields, show };

  /** Show the scenario: anew where a vehicle or landmark came or went. */
  function show() {
    if (namesIn(store.scenario) === names) fields.show(store.scenario);
    else build();
  }

  function build() {
    const { scenario, selected, chosen } = store;
    if (!scenario) return;
    names = namesIn(scenario);
    fields.clear();
    const named = (kind) => BODIES[kind].all(scenario).map(({ name }, k) => [`${kind} ${k}`, name]);
    const polygons = polygonsOf(scenario).map(({ kind, k }) => [`${kind} ${k}`, kind === "area" ? kind : `${kind} ${k + 1}`]);
    const vehicles = named("vehicle");
    const titles = Object.fromEntries([["", "choose, here or on the map …"], ...vehicles, ...named("landmark"), ...polygons]);
    const value = selected ? `${selected.kind} ${selected.k}` : "";
    const known = value in titles ? selected : null;
    const picker = element("select", { id: "chosen", "aria-label": "Vehicle or landmark", onchange: () => pick(picker.value) }, options(titles));
    picker.value = known ? value : "";
    const places = placesOf(scenario, chosen);
    const focused = group.contains(document.activeElement) ? document.activeElement?.id : "";
    const parts = [
      element("legend", {}, chosen.length > 1 ? `${chosen.length} selected; last of them` : "Selected vehicle or landmark"),
      element("div", { class: "field wide" }, element("label", { for: "chosen" }, "Vehicle or landmark"), picker),
      known && fieldsOf(known),
      element("div", { class: "row" }, [
        button("Add vehicle", () => grow("vehicle")),
        button("Add landmark", () => grow("landmark")),
        places.length && button("Copy", () => change(copyChosen)),
        places.length && button("Align to grid", align),
        known && (known.kind !== "vehicle" || vehicles.length > 1) && button("Remove", () => change(removeChosen)),
      ]),
      known && known.kind in BODIES && element("div", { class: "row" }, switchesOf(known)),
      candidates(),
    ];
    group.replaceChildren(...present(parts));
    if (focused) byId(focused)?.focus();
    fields.show(scenario);
  }

  /** Buttons that switch the body off and on, on the map, and a vehicle's sensor. */
  function switchesOf({ kind, k }) {
    const { name } = BODIES[kind].all(store.scenario)[k];
    const parts = kind === "vehicle" ? [name, `sensor:${name}`] : [name];
    return parts.map((one) => switchOf(store, one));
  }

  function fieldsOf({ kind, k }) {
    if (kind in FIELDS) return FIELDS[kind](k, store.scenario).map((one) => fieldOf(kind, k, one));
    return element("p", { class: "hint" }, "Drag its corners on the map, or a point of an edge for one more; a click with Alt takes a corner out.");
  }

  function fieldOf(kind, k, field) {
    const { key, path } = field;
    const { all, moved } = BODIES[kind];
    const change = (old, value) => {
      // one that is being typed anew is empty for a moment
      if (value === "") return old;
      if (key === "name") return renamed(old, kind, k, value);
      if (key === "direction") return withDirection(old, store.plan, k, value);
      const { x, y } = Object.assign({}, all(old)[k], { [key]: value });
      return key === "x" || key === "y" ? moved(old, k, x, y) : withValue(old, path, value);
    };
    const read = (scenario) => {
      const body = all(scenario, store.plan)[k];
      return { ...body, ...body?.sensor }[key];
    };
    return fields.add({ id: `chosen-${key}`, read, change, ...field });
  }

  function pick(value) {
    const [kind, k] = value.split(" ");
    store.select(value ? { kind, k: Number(k) } : null);
    byId("chosen").focus();
  }

  /** Put one more where there is room for it, and select it. */
  function grow(kind) {
    const { place, noRoom } = GROWTH[kind];
    const { scenario, given } = store;
    const at = place(scenario);
    if (!at) {
      notice(`There is no room ${noRoom}: move something, or enlarge the area.`, { fault: true });
      return;
    }
    addBody(store, kind, at, { reveal: true });
    // that phases were lost is said already, and matters more
    const { links } = store.scenario.formation;
    const link = links?.length > scenario.formation.links?.length ? `, with the link ${links.at(-1).join("-")}` : "";
    if (!given) notice(`${BODIES[kind].all(store.scenario).at(-1).name} added at ${placesIn(store.scenario)(at)}${link}.`);
    byId("chosen").focus();
  }

  /** What keeps the best of the landmarks that are selected; null where there is nothing to choose. */
  function candidates() {
    const landmarks = landmarksOf(store.scenario);
    const sites = store.chosen.filter(({ kind, k }) => kind === "landmark" && landmarks[k]);
    if (sites.length < 2) return null;
    const count = element("input", { id: "best-count", type: "number", value: Math.ceil(sites.length / 2), "aria-label": "Landmarks to keep" });
    const keep = button("Keep the best", () => attempt(() => keepBest(sites, count.value)));
    return element("div", { class: "row" }, keep, count, `of these ${sites.length} landmarks`);
  }

  /** Remove all of these landmarks but so many, by which the worst vehicle is known best. */
  async function keepBest(sites, count) {
    const { scenario } = store;
    const nameOf = ({ k }) => landmarksOf(scenario)[k].name;
    const asked = new URLSearchParams([["choose", count], ...sites.map((one) => ["candidate", nameOf(one)])]);
    const { chosen, value_m: bound, proven_best: proven } = await askJson("GET", `v1/plans/${await storePlan()}/landmark-choice?${asked}`);
    if (store.scenario !== scenario) return;
    store.select(null);
    store.edit(withoutChosen(scenario, sites.filter((one) => !chosen.includes(nameOf(one)))));
    notice(`Kept ${chosen.join(", ")}: the worst vehicle's window bound is ${shown(bound, "m")}${proven ? ", and no other choice has a smaller one" : ""}.`);
  }

  function change(make) {
    make(store);
    byId("chosen").focus();
  }

  function align() {
    const { scenario, chosen } = store;
    // a round length of about half the mean radius
    const step = roundBelow(mean(vehiclesOf(scenario).map((one) => one.radius)) / 2);
    store.edit(withAligned(scenario, chosen, step));
    notice(`Aligned to a grid of ${shown(step, "m")}.`);
  }
}

/** The scenario with a body renamed, unless another has that name. */
function renamed(scenario, kind, k, name) {
  const { all, named } = BODIES[kind];
  if (!all(scenario).some((one) => one.name === name)) return named(scenario, k, name);
  notice(`There is a ${kind} ${name} already.`, { fault: true });
  return scenario;
}

function namesIn(scenario) {
  const named = [vehiclesOf(scenario), landmarksOf(scenario)].map((all) => all.map((one) => one.name));
  return JSON.stringify([...named, polygonsOf(scenario).length]);
}
