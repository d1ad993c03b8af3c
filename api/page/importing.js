// What a file of the field becomes: its features in a dialogue, with what the service takes each for.

import { eachPlace } from "./coordinates.js";
import { groundPointOf, middleOf } from "./earth.js";
import { alert, attemptAt, button, dialogue, element, notice, options, present, table } from "./elements.js";
import { round } from "./scenario.js";

/** What features become, and where a scenario keeps it: before "_m" or "_lat_lon_deg". */
const SECTIONS = { area: ["area", "area"], keep_out: ["keep-out", "keep_out"], obstacle: ["obstacle", "obstacles"], landmark: ["landmark", "landmarks"] };
const NONE = "left_out";
const KEYS = Object.values(SECTIONS).map(([, key]) => key);

/** Show the features of an import, and let them be added to a store's scenario or begin a new one.
 * @param {any} store
 * @param {any} imported
 * @param {{name: string, open: (scenario: any) => Promise<void>, fit: () => void}} how */
export function showImport(store, { features, scenario, notes }, { name, open, fit }) {
  const choices = features.map((feature, k) => choiceOf(feature, `${feature.name || feature.geometry}, ${k + 1} becomes`));
  const reasons = features.map(({ reason }) => element("span", {}, reason));
  const fault = alert();
  const takes = (task) => () =>
    attemptAt(fault, async () => {
      const places = placesFrom(features, choices.map((choice) => choice.value));
      if (!Object.keys(places).length) throw new Error("All features are left out: choose what one of them becomes.");
      await task(places);
      made.close();
    });
  const add = takes((places) => {
    const changed = withPlaced(store.scenario, places);
    store.select(null);
    store.edit(changed);
    fit();
    notice(`${name}: added to this scenario. Undo takes it back.`);
  });
  const rows = features.map((feature, k) => [present([feature.name || "—", feature.folder && element("span", { class: "hint block" }, feature.folder)]), feature.geometry, choices[k], reasons[k]]);
  const listed = element("div", { class: "front features", tabindex: "0", role: "region", "aria-label": "Features" }, table(["Name and folder", "Geometry", "Becomes", "Reason"], rows));
  listed.addEventListener("change", ({ target }) => {
    choices.forEach((choice, k) => {
      // there is one area
      if (target.value === "area" && choice !== target && choice.value === "area") choice.value = NONE;
      reasons[k].textContent = choice.value === features[k].section ? features[k].reason : "your choice";
    });
  });
  const made = dialogue(
    "import",
    `Places of ${name}`,
    { class: "broad" },
    element("p", { class: "hint" }, "Added places replace the scenario's own of the same kind: its area, keep-outs, obstacles or landmarks. Holes of the area become keep-outs."),
    listed,
    notes.map((note) => element("p", { class: "remark note" }, note)),
    fault,
    element("div", { class: "row" }, button("Add to this scenario", add, { class: "primary" }), button("Start a new scenario", takes((places) => open(withDegrees(scenario, places))))),
  );
}

/** The choice of what a feature becomes: points are landmarks, what has corners enough polygons. */
function choiceOf({ geometry, section, lat_lon_deg: places }, label) {
  const may = Object.keys(SECTIONS).filter((kind) => (kind === "landmark") === (geometry === "point") && (geometry === "point" || places.length > 2));
  const texts = Object.fromEntries(may.map((kind) => [kind, SECTIONS[kind][0]]));
  const choice = element("select", { "aria-label": label }, options({ ...texts, [NONE]: "left out" }));
  choice.value = section;
  return choice;
}

/** What features become by their choices, in degrees, by the key of a scenario; holes of the area are keep-outs.
 * @param {any[]} features @param {string[]} choices */
export function placesFrom(features, choices) {
  const chosen = (section) => features.filter((_, k) => choices[k] === section);
  const corners = (section) => chosen(section).map((feature) => feature.lat_lon_deg);
  const [area] = chosen("area");
  /** @type {Record<string, number[]>} */
  const landmarks = {};
  for (const { name, lat_lon_deg: [place] } of chosen("landmark")) landmarks[freeName(name || "landmark", landmarks)] = place;
  const places = { area: area?.lat_lon_deg ?? [], keep_out: [...corners("keep_out"), ...(area?.holes_lat_lon_deg ?? [])], obstacles: corners("obstacle"), landmarks };
  return Object.fromEntries(Object.entries(places).filter(([, value]) => Object.keys(value).length));
}

/** A name that no other landmark has. */
function freeName(name, landmarks) {
  let [free, number] = [name, 1];
  while (free in landmarks) free = `${name} ${++number}`;
  return free;
}

/** The scenario with places in m; without an origin, theirs is the middle of them. */
export function withPlaced(scenario, places) {
  /** @type {number[][]} */
  const all = [];
  eachPlace(places, (place) => all.push(place));
  const origin = scenario.geo_origin ?? { ...middleOf(all), alt_m: 0 };
  const keys = Object.entries(places).map(([key, value]) => [`${key}_m`, eachPlace(value, (place) => groundPointOf(origin, place).map(round))]);
  return { ...scenario, geo_origin: origin, ...Object.fromEntries(keys) };
}

/** The scenario with these places in degrees and no others. */
export function withDegrees(scenario, places) {
  const keys = KEYS.map((key) => `${key}_lat_lon_deg`);
  const rest = Object.entries(scenario).filter(([key]) => !keys.includes(key));
  return Object.fromEntries([...rest, ...Object.entries(places).map(([key, value]) => [`${key}_lat_lon_deg`, value])]);
}
