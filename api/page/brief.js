// The brief of a design: one object, whose keys the form edits, and all of which the text does. Its field is that of the map.

import { attemptAt, byId, element, mark, onceChosen, options } from "./elements.js";
import { INPUTS, inputValue, optionField } from "./requests.js";
import { landmarksOf, rounded, roundBelow, sameScenario, valueAt, vehiclesOf } from "./scenario.js";
import { ask } from "./service.js";
import { BRIEF } from "./tables.js";

const MOST_VEHICLES = 8;
/** the error that is allowed by default, in shares of the sensor's range */
const ERROR_SHARE = 0.04;
/** keys of the field: what is drawn on the map, and where on Earth it lies */
const ON_MAP = /^(area|keep_out|obstacles)_|^geo_origin$/;
const LISTED = new Intl.ListFormat("en-GB");

/** The brief over a store's map: `asked()` returns what is sent, an object or the text as typed, `whole()` whether it has an
 * area, and `take(request)` puts the brief of a design in its place. */
export function briefOn(store) {
  const [form, area, takeArea, fields, folder, text] = ["design-form", "brief-area", "take-area", "brief-fields", "brief-text", "brief"].map(byId);
  const submit = form.querySelector("[type=submit]");
  const groups = BRIEF.groups.map(groupOf);
  /** @type {any} */
  let brief = {};
  /** what is sent: the brief, or the text once that was typed; a fault of all of it has no path, and so the text no name @type {any} */
  let asked = brief;
  /** the field of the map */
  let drawn = {};
  /** whether the brief is that of the scenario on show: until somebody changes it */
  let follows = true;

  fields.append(...groups.map(({ box }) => box));
  form.addEventListener("input", ({ target }) => (target === text ? read(text.value) : edit(target)));
  folder.addEventListener("toggle", write);
  takeArea.addEventListener("click", () => put(withField(brief, drawn)));
  const bring = (task) => attemptAt(byId("brief-source-fault"), async () => read(await task()));
  onceChosen(byId("brief-file"), (file) => bring(() => file.text()));
  onceChosen(byId("brief-example"), (name) => {
    follows = name === "map";
    if (follows) follow();
    else bring(async () => (await ask("GET", `assets/briefs/${name}.yaml`, { accept: "application/yaml" })).text());
  });
  store.on(["opened", "scenario", "plan"], follow);
  return { asked: () => asked, whole: () => submit.ariaDisabled !== "true", take };

  function take(request) {
    follows = false;
    // a request has null for what is not given
    put(JSON.parse(JSON.stringify(request), (_, value) => value ?? undefined));
  }

  /** Follow the field of the map, and all of the scenario on show until somebody changes the brief. */
  function follow() {
    const before = drawn;
    drawn = fieldOf(store.scenario);
    const own = fieldOf(brief);
    const moved = !sameScenario(drawn, before) && !sameScenario(drawn, own) && ("area_m" in drawn || sameScenario(own, before));
    if (follows || (moved && !fields.disabled)) put(follows ? briefOf(store) : withField(brief, drawn));
    else if (!fields.disabled) state("");
  }

  /** Show a brief in the form, and in the text if that is open; `typed` is where it was typed, and stays as it is. */
  function put(changed, typed = null) {
    brief = changed;
    if (typed !== text) asked = brief;
    for (const { section, kinds, choice, inner } of groups) {
      const kind = kindOf(brief[section], kinds);
      if (choice) choice.value = kind;
      for (const { option, box, input } of inner) {
        box.hidden = input.disabled = option.of !== null && option.of !== kind;
        const value = valueAt(brief, option.key) ?? option.default ?? "";
        if (input !== typed) input.value = INPUTS[option.kind].word?.(value) ?? value;
      }
    }
    state("");
    write();
  }

  /** Take what was typed into a field, or the kind that was chosen for a section. */
  function edit(target) {
    const group = groups.find(({ choice }) => choice === target);
    const option = groups.flatMap(({ inner }) => inner).find(({ input }) => input === target)?.option;
    const value = option && INPUTS[option.kind].read(inputValue(target));
    follows &&= !(group || option);
    if (group) put({ ...brief, [group.section]: startOf(target.value, store.scenario, brief[group.section]) });
    // what is no number yet is a fault once the form is handed in
    else if (option && !Number.isNaN(value)) put(withKey(brief, option.key.split("."), typeof option.default === "number" ? Number(value) : (value ?? undefined)), target);
  }

  /** Take a text; while it can't be read, the fields wait. */
  async function read(given) {
    follows = false;
    asked = text.value = given;
    const { load } = await import("./vendor/yaml.js");
    if (asked !== given) return;
    try {
      put(Object(load(given)), text);
    } catch (error) {
      state(error.message.split("\n")[0]);
    }
  }

  async function write() {
    if (!folder.open) return;
    const { dump } = await import("./vendor/yaml.js");
    if (asked === brief) text.value = dump(brief, { flowLevel: 1 });
  }

  /** State what is wrong with the text, and the field in words. */
  function state(fault) {
    mark(text, fault);
    const count = (key) => Object(brief[`${key}_m`] ?? brief[`${key}_lat_lon_deg`]).length ?? 0;
    const counts = [["corner", count("area")], ["keep-out", count("keep_out")], ["obstacle", count("obstacles")]].filter(([, number]) => number);
    const parts = counts.map(([word, number]) => `${number} ${word}${number === 1 ? "" : "s"}`);
    const same = sameScenario(fieldOf(brief), drawn);
    const words = count("area") ? `Area of ${LISTED.format(parts)}, ${same ? "as drawn on the map" : "as the brief states"}.` : "Draw an area first (tool Area).";
    if (area.textContent !== words) area.textContent = words;
    takeArea.hidden = same || !("area_m" in drawn);
    fields.disabled = fault !== "";
    submit.setAttribute("aria-disabled", !count("area") && !fault);
  }
}

/** A group of fields: its element, the choice of its kind, if it has kinds, and what is in it by field. */
function groupOf({ title, kinds, fields }) {
  const section = title.toLowerCase();
  const choice = kinds && element("select", { id: `design-${section}`, name: section, "aria-label": title }, options(kinds));
  const inner = fields.map((option) => {
    const box = element("div", {}, optionField("design", option));
    return { option, box, input: box.querySelector("[name]") };
  });
  const box = element("fieldset", {}, element("legend", {}, title), choice && element("div", { class: "field wide" }, choice), inner.map((field) => field.box));
  return { section, kinds, choice, box, inner };
}

/** The kind of a section: the first of their keys that it has, in metres or degrees. */
function kindOf(section, kinds) {
  return Object.keys(kinds ?? {}).find((key) => section?.[key] || section?.[key.replace(/(_m)?$/, "_lat_lon_deg")]) ?? "";
}

/** What a section is once its kind is chosen over a scenario, and what it was before. */
function startOf(kind, scenario, before) {
  const vehicles = vehiclesOf(scenario);
  const sites = landmarksOf(scenario).map(({ x, y }) => [x, y]);
  const max = before?.max ?? Math.max(2, sites.length);
  return {
    cover: { cover: { share: 0.8, swath_m: vehicles[0].sensor.range_m } },
    visit_m: { visit_m: [] },
    keep: { keep: { count: vehicles.length, spread_m: 2 * Math.max(...vehicles.map(({ radius }) => radius)) } },
    "": { max },
    on_edge: { max, on_edge: true },
    candidates_m: { candidates_m: sites },
    given: { given: sites },
  }[kind];
}

/** The brief that suits a scenario on show: its field, the keys that both have, and limits such as its team flies within. */
function briefOf({ scenario, plan }) {
  const vehicles = vehiclesOf(scenario);
  const radii = vehicles.map(({ radius }) => radius);
  const { speed_mps = rounded((2 * Math.PI * Math.max(...radii)) / plan.period_s, 3), turn_rate_rad_s } = scenario.limits ?? {};
  const shared = BRIEF.shared.map((key) => [key, [scenario[key]].flat()[0]]);
  return {
    ...fieldOf(scenario),
    vehicle: { speed_mps, min_radius_m: Math.min(...radii), turn_rate_rad_s },
    ...Object.fromEntries(shared.filter(([, value]) => (value ?? null) !== null)),
    team: { max: Math.min(vehicles.length, MOST_VEHICLES) },
    landmarks: startOf("", scenario),
    purpose: scenario.purpose ?? startOf("cover", scenario),
    need: { worst_rms_m: roundBelow(ERROR_SHARE * vehicles[0].sensor.range_m) },
  };
}

/** The field of a scenario or a brief. */
function fieldOf(values) {
  return Object.fromEntries(Object.entries(values).filter(([key, value]) => ON_MAP.test(key) && value));
}

/** Return a brief with another field. */
function withField(brief, field) {
  return { ...field, ...Object.fromEntries(Object.entries(brief).filter(([key]) => !ON_MAP.test(key))) };
}

/** Return values with another one at a path; undefined takes the key out.
 * @param {any} values
 * @param {string[]} path
 * @param {any} value */
function withKey(values, [key, ...inner], value) {
  const present = values instanceof Object ? values : {};
  return { ...present, [key]: inner.length ? withKey(present[key], inner, value) : value };
}
