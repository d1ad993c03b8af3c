// The vehicle or landmark that was chosen: its own part of the form, and how one comes or goes.

import { coordinatesOf, cornersIn, placedField } from "./coordinates.js";
import { attempt, button, byId, element, notice, options, present, shown } from "./elements.js";
import { Fields } from "./fields.js";
import { freeCenter, freeSite } from "./free_space.js";
import { nameOf } from "./grips.js";
import { switchOf } from "./losses.js";
import { landmarksOf, mean, polygonAt, polygonsOf, roundBelow, vehiclesOf, withAltitude, withDirection, withPolygon, withRadius, withValue } from "./scenario.js";
import { addBody, BODIES, copyChosen, placesOf, removeChosen, withAligned, withoutChosen, withPolygonAdded } from "./selection.js";
import { askJson } from "./service.js";

const TURNS = { ccw: "counter-clockwise", cw: "clockwise" };

/** Where there is room for one more of a kind, and what lacks room. */
const GROWTH = {
  vehicle: { place: freeCenter, noRoom: "for another circle of the last one's size" },
  landmark: { place: freeSite, noRoom: "for another landmark" },
};

/** The fields of vehicle or landmark k, by its kind. */
const FIELDS = {
  vehicle: (k, _scenario, coordinates) => [
    { key: "name", path: `formation.names[${k}]`, label: "Its name", kind: "name" },
    ...positionFields(coordinates, `formation.centers_m[${k}]`, (axis) => `Centre ${axis}`),
    { key: "radius", path: `orbit.radius_m[${k}]`, label: "Radius", unit: "m", min: 0 },
    { key: "direction", path: `orbit.direction[${k}]`, label: "Its direction", kind: "choice", choices: (value) => [TURNS, value] },
    { key: "altitude", id: "body-altitude", path: `altitude_m[${k}]`, label: "Its altitude above ground", unit: "m", steady: true },
    { key: "range_m", path: `sensor[${k}].range_m`, label: "Its range", unit: "m", min: 0 },
    { key: "fov_deg", path: `sensor[${k}].fov_deg`, label: "Its field of view", unit: "°", min: 0, max: 360 },
    { key: "boresight_deg", path: `sensor[${k}].boresight_deg`, label: "Its boresight", unit: "°" },
  ],
  landmark: (k, { landmarks_m: landmarks }, coordinates) => {
    const place = Array.isArray(landmarks) ? `landmarks_m[${k}]` : `landmarks_m.${Object.keys(landmarks)[k]}`;
    return [
      { key: "name", path: place, label: "Its name", kind: "name" },
      ...positionFields(coordinates, place, (axis) => axis[0].toUpperCase() + axis.slice(1)),
    ];
  },
};

/** The two fields of a position; `title(axis)` labels them. */
function positionFields({ axes, field }, path, title) {
  return axes.map(({ key, label, at }, axis) => ({ key, axis, path: `${path}[${at}]`, label: title(label), ...field }));
}

/** The part of the form for one vehicle or landmark of a store's scenario.
 *
 * `storePlan()` resolves with the identifier of the plan on show. Returns the element to put in the form, its fields, and
 * what shows the scenario.
 */
export function bodyPart(store, storePlan) {
  const group = element("fieldset", { class: "group" });
  const fields = new Fields(store);
  let names = "";
  store.on(["opened", "selected", "degrees"], build);
  return { group, fields, show };

  /** Show the scenario: anew where a vehicle or landmark came or went. */
  function show() {
    if (namesIn(store) === names) fields.show(store.scenario);
    else build();
  }

  function build() {
    const { scenario, selected, chosen } = store;
    if (!scenario) return;
    names = namesIn(store);
    fields.clear();
    const named = (kind) => BODIES[kind].all(scenario).map(({ name }, k) => [`${kind} ${k}`, name]);
    const polygons = polygonsOf(scenario).map((polygon) => [`${polygon.kind} ${polygon.k}`, nameOf(polygon)]);
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
        ["area", "keep-out", "obstacle"].filter((kind) => kind !== "area" || !scenario.area_m).map((kind) => button(`Add ${kind}`, () => change(() => withPolygonAdded(store, kind)))),
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
    if (!(kind in FIELDS)) return cornersOf(kind, k);
    const coordinates = coordinatesOf(store);
    return FIELDS[kind](k, store.scenario, coordinates).map((field) => {
      const access = field.axis === undefined ? partOf(kind, k, field) : positionOf(kind, k, field.axis, coordinates);
      return fields.add({ id: `chosen-${field.key}`, ...access, ...field });
    });
  }

  /** The field of a polygon's corners, and how they are changed on the map. */
  function cornersOf(kind, k) {
    const { key, corners } = { ...polygonAt(store.scenario, { kind, k }) };
    const { read, change: changed, unitOf } = placedField(store, {
      read: (scenario) => polygonAt(scenario, { kind, k })?.corners ?? corners,
      change: (scenario, pairs) => withPolygon(scenario, kind, pairs, k),
    });
    const field = fields.add({
      id: "chosen-corners",
      path: kind === "area" ? key : `${key}[${k}]`,
      label: "Corners",
      kind: "text",
      whole: true,
      unitOf,
      read: (scenario) => read(scenario).map((pair) => pair.join(", ")).join("; "),
      change: (scenario, text) => changed(scenario, cornersIn(text)),
    });
    return [field, element("p", { class: "hint" }, "Drag corners on the map, or a point of an edge for one more. Delete takes out the corner that has the focus, and so does a click with Alt.")];
  }

  /** How a field of a body reads and changes a scenario. */
  function partOf(kind, k, { key, path }) {
    const { all } = BODIES[kind];
    const change = (old, value) => {
      // one that is being typed anew is empty for a moment
      if (value === "") return old;
      if (key === "name") return renamed(old, kind, k, value);
      if (key === "altitude") return withAltitude(old, k, value);
      if (key === "radius") return withRadius(old, k, value);
      if (key === "direction") return withDirection(old, store.plan, k, value);
      return withValue(old, path, value);
    };
    const read = (scenario) => {
      const body = all(scenario, store.plan)[k];
      return { ...body, ...body?.sensor }[key];
    };
    return { read, change };
  }

  /** How a field of a position does: by one of its two numbers, or both where a pair is pasted. */
  function positionOf(kind, k, axis, { of, shown, taken }) {
    const { all, moved } = BODIES[kind];
    const pairOf = (scenario) => {
      const { x, y } = { ...all(scenario)[k] };
      return of([x, y]);
    };
    const pasted = (old, pair) => {
      const [x, y] = taken(pair);
      return moved(old, k, x, y);
    };
    const change = (old, value) => (value === "" ? old : pasted(old, pairOf(old).with(axis, value)));
    return { read: (scenario) => shown(pairOf(scenario)[axis]), change, pasted };
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
    if (!given) notice(`${BODIES[kind].all(store.scenario).at(-1).name} added at ${coordinatesOf(store).words(at)}${link}.`);
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

/** What the part is built for: names, the number of polygons, and the origin of degrees. */
function namesIn({ scenario, degrees }) {
  const named = [vehiclesOf(scenario), landmarksOf(scenario)].map((all) => all.map((one) => one.name));
  return JSON.stringify([...named, polygonsOf(scenario).length, degrees && scenario.geo_origin]);
}
