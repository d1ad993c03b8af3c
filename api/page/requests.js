// What can be asked of a plan: forms, and those of a refinement, a validation and a flight.

import { alert, element, mark, options } from "./elements.js";
import { mean, vehiclesOf } from "./scenario.js";
import { GUIDANCES, OBJECTIVES } from "./tables.js";

/** so many vehicles have figures over time */
const SERIES_LIMIT = 24;
/** how far refinement may go by default, in shares of the radii */
const BOX_SHARE = 0.25;
const RADIUS_SHARES = [0.75, 1.25];
const SEED = 1;
/** What each guidance is called here; the others by their names. */
const STEERING = { track: "keep to the plan", mpc: "look ahead, keep apart", none: "open loop" };

/** A form that hands in a request.
 *
 * Its inputs have the names of the request's keys; what is disabled just now is not looked at. `read(values)` makes the
 * request of their values, `handIn(form, request)` takes it, and `suited(scenario)` returns values that suit a scenario.
 */
export class RequestForm {
  #suited;
  #typed = new Set();
  #rest = alert();

  constructor(kind, title, hint, { rows, handIn, read = (values) => values, suited = (_scenario) => ({}) }) {
    this.kind = kind;
    this.#suited = suited;
    this.button = element("button", { type: "submit", class: "primary" }, title);
    const about = element("p", { class: "hint" }, hint);
    this.element = element("form", { class: "task", novalidate: true, "aria-label": title }, about, ...rows, this.button, this.#rest);
    this.element.addEventListener("submit", (event) => {
      event.preventDefault();
      this.clear();
      if (this.#whole()) handIn(this, read(this.#values));
    });
    this.element.addEventListener("input", ({ target }) => this.#typed.add(target.name));
  }

  /** Put in what suits a scenario, wherever people have typed nothing themselves. */
  suit(scenario) {
    for (const [name, value] of Object.entries(this.#suited(scenario))) {
      if (!this.#typed.has(name)) this.element.elements.namedItem(name).value = value;
    }
  }

  /** Show what is wrong next to the fields it concerns. */
  showFault({ faults = [], message }) {
    const rest = [];
    for (const { path, message: text } of faults) {
      const input = this.#inputs.find(({ name }) => name === path) ?? this.#inputs.find(({ name }) => name === path.replace(/\[\d+\]$/, ""));
      if (input) mark(input, text);
      else rest.push(`${path}: ${text}`);
    }
    this.#rest.textContent = faults.length ? rest.join("; ") : message;
  }

  clear() {
    for (const input of this.#inputs) mark(input, "");
    this.#rest.textContent = "";
  }

  /** @returns {any[]} */
  get #inputs() {
    return [...this.element.elements].filter((one) => one.hasAttribute("name"));
  }

  get #values() {
    const counted = this.#inputs.filter((one) => !one.disabled);
    return Object.fromEntries(counted.map((one) => [one.name, one.type === "number" ? one.valueAsNumber : one.value]));
  }

  /** Whether every number that counts is one; the others are marked. */
  #whole() {
    const missing = this.#inputs.filter((one) => !one.disabled && Number.isNaN(this.#values[one.name]));
    for (const input of missing) mark(input, "is missing or not a number");
    missing[0]?.focus();
    return missing.length === 0;
  }
}

/** The form of a refinement. */
export function refinementForm(handIn) {
  const objective = choice("refine-objective", "objective", OBJECTIVES);
  // the first is that of the service, which takes another for large teams: it is not named
  objective.options[0].value = "";
  const box = number("refine-box", "center_box_m", 5, "How far a centre may move each way, in m");
  const least = number("refine-least", "radius_m", 15, "Least radius in m");
  const most = number("refine-most", "radius_m[1]", 25, "Largest radius in m");
  const read = ({ "radius_m[1]": to, radius_m: from, objective: named, ...rest }) => ({
    ...rest,
    vary: ["phases", ...(box.disabled ? [] : ["centers"]), ...(most.disabled ? [] : ["radii"])],
    ...(most.disabled ? {} : { radius_m: [from, to] }),
    ...(named ? { objective: named } : {}),
  });
  const rows = [
    wide("Objective", objective),
    element("p", {}, "Move phases and"),
    element("div", { class: "row" }, check("refine-centers", "centres, by up to", true, [box]), amount(box, "m")),
    faultOf(box),
    element("div", { class: "row" }, check("refine-radii", "radii", false, [least, most]), amount(least, "to", most, "m")),
    faultOf(least),
    faultOf(most),
    labelled("Time limit (s)", number("refine-time", "time_limit_s", 30)),
  ];
  return new RequestForm("refinement", "Refine", "Move phases, centres and radii to improve the plan.", { rows, read, handIn, suited: roomOf });
}

/** How far refinement may go by default: what the scenario says, else shares of the team's radii. */
function roomOf(scenario) {
  const radii = vehiclesOf(scenario).map((one) => one.radius);
  const { center_box_m: box, radius_m: asked } = scenario.refine || {};
  const [least, most] = asked || [tidy(RADIUS_SHARES[0] * Math.min(...radii)), tidy(RADIUS_SHARES[1] * Math.max(...radii))];
  return { center_box_m: box || tidy(BOX_SHARE * mean(radii)), radius_m: least, "radius_m[1]": most };
}

/** A number of two digits, as people would type it. */
function tidy(value) {
  return Number(value.toPrecision(2));
}

/** The form of a validation; `size()` returns the number of vehicles. */
export function validationForm(size, handIn) {
  const rows = [labelled("Trials", number("validate-trials", "trials", 200)), labelled("Seed", number("validate-seed", "seed", 1))];
  const read = (values) => ({ ...values, series: size() <= SERIES_LIMIT });
  const hint = "Simulate the plan many times with the filter and compare its errors with the prediction.";
  return new RequestForm("validation", "Validate", hint, { rows, read, handIn });
}

/** The form of a flight; `size()` returns the number of vehicles. */
export function flightForm(size, handIn) {
  const guidance = choice("fly-guidance", "guidance", Object.fromEntries(Object.keys(GUIDANCES).map((name) => [name, STEERING[name] ?? name])));
  const explained = element("p", { class: "hint" }, GUIDANCES[guidance.value]);
  guidance.addEventListener("change", () => (explained.textContent = GUIDANCES[guidance.value]));
  const rows = [
    labelled("Flights", number("fly-trials", "trials", 50)),
    wide("Steering", guidance),
    explained,
    labelled("Wind x, y (m/s)", typed("fly-wind", "wind_mps", { placeholder: "scenario’s" })),
    wide("Lost on the way", typed("fly-lose", "lose", { placeholder: "v3@60, L1@90" })),
    wide("Held on the way", typed("fly-hold", "hold", { placeholder: "v2@100:20" })),
    element("p", { class: "hint" }, "v3@60: at 60 s; v2@100:20: from 100 s on, for 20 s. Also landmarks, and sensors as sensor:v3@60."),
  ];
  const read = ({ wind_mps: wind, lose, hold, ...rest }) => ({
    ...rest,
    seed: SEED,
    lose: listed(lose),
    hold: listed(hold),
    // what is no number is for the service to refuse
    ...(wind.trim() ? { wind_mps: listed(wind).map(Number) } : {}),
    series: size() <= SERIES_LIMIT,
  });
  const hint = "Fly the plan many times: vehicles steer by their own estimates, in wind, with losses.";
  return new RequestForm("flight", "Fly", hint, { rows, read, handIn });
}

/** What a text lists, between commas or spaces. */
export function listed(text) {
  return text.split(/[\s,;]+/).filter(Boolean);
}

/** An input for text. */
export function typed(id, name, attributes) {
  return element("input", { id, name, type: "text", autocomplete: "off", spellcheck: "false", "aria-describedby": `${id}-fault`, ...attributes });
}

export function number(id, name, value, label) {
  return typed(id, name, { type: "number", step: "any", value, "aria-label": label });
}

/** A choice among texts by their values. */
export function choice(id, name, texts) {
  return element("select", { id, name, "aria-describedby": `${id}-fault` }, options(texts));
}

/** A box with its label; inputs are of use while it is checked. */
function check(id, text, checked, inputs) {
  const enable = () => {
    for (const one of inputs) one.disabled = !box.checked;
  };
  const box = element("input", { id, type: "checkbox", checked, onchange: enable });
  enable();
  return element("label", { for: id, class: "check" }, box, ` ${text}`);
}

/** Numbers and their unit, on one line whatever the width. */
function amount(...parts) {
  return element("span", { class: "amount" }, ...parts);
}

function faultOf(input) {
  return element("p", { class: "fault", id: `${input.id}-fault` });
}

/** An input below its label, where one beside it has no room. */
export function wide(text, input) {
  return labelled(text, input, "field wide");
}

export function labelled(text, input, look = "field") {
  return element("div", { class: look }, element("label", { for: input.id }, text), input, faultOf(input));
}
