// What can be asked of a plan: forms, and those of a refinement and of a validation.

import { element, mark } from "./elements.js";
import { vehiclesOf } from "./scenario.js";
import { OBJECTIVES } from "./tables.js";

/** so many vehicles have figures over time */
export const SERIES_LIMIT = 24;
/** how far refinement may go by default, in shares of the radii */
const BOX_SHARE = 0.25;
const RADIUS_SHARES = [0.75, 1.25];

/** A form that hands in a job.
 *
 * `kind` is the job's; `read()` returns the request; `fields` are its inputs by the request's keys; an input that does
 * not count just now is not looked at.
 */
export class RequestForm {
  #fields;
  #read;
  #rest;
  #suited;
  #typed = new Set();

  constructor(kind, title, hint, { fields, read, rows, handIn, suited = (_scenario) => ({}) }) {
    this.kind = kind;
    this.#suited = suited;
    this.#fields = fields;
    this.#read = read;
    this.button = element("button", { type: "submit", class: "primary" }, title);
    this.#rest = element("p", { class: "fault", role: "alert" });
    this.element = element(
      "form",
      { class: "task", novalidate: true, "aria-label": title },
      element("p", { class: "hint" }, hint),
      ...rows,
      this.button,
      this.#rest,
    );
    this.element.addEventListener("submit", (event) => {
      event.preventDefault();
      this.clear();
      if (this.#whole()) handIn(this, this.#read());
    });
    for (const [key, input] of Object.entries(fields)) input.addEventListener("input", () => this.#typed.add(key));
  }

  /** Put in what suits a scenario, wherever people have typed nothing themselves. */
  suit(scenario) {
    for (const [key, value] of Object.entries(this.#suited(scenario))) {
      if (!this.#typed.has(key)) this.#fields[key].value = value;
    }
  }

  /** Show what is wrong next to the fields it concerns. */
  showFault(error) {
    const rest = [];
    for (const { path, message } of error.faults || []) {
      const input = this.#fields[path] || this.#fields[path.replace(/\[\d+\]$/, "")];
      if (input) mark(input, message);
      else rest.push(`${path}: ${message}`);
    }
    this.#rest.textContent = rest.join("; ") || ((error.faults || []).length ? "" : error.message);
  }

  clear() {
    for (const input of Object.values(this.#fields)) mark(input, "");
    this.#rest.textContent = "";
  }

  /** Whether every number that counts is one; the others are marked. */
  #whole() {
    const missing = Object.values(this.#fields).filter(
      (input) => input.type === "number" && !input.disabled && Number.isNaN(input.valueAsNumber),
    );
    for (const input of missing) mark(input, "is missing or not a number");
    missing[0]?.focus();
    return missing.length === 0;
  }
}

/** The form of a refinement. */
export function refinementForm(handIn) {
  const objective = choice("refine-objective", OBJECTIVES);
  // the first is that of the service, which takes another for large teams: it is not named
  objective.options[0].value = "";
  const centers = check("refine-centers", "centres, by up to", true);
  const box = number("refine-box", 5, "How far a centre may move each way, in m");
  const radii = check("refine-radii", "radii", false);
  const least = number("refine-least", 15, "Least radius in m");
  const most = number("refine-most", 25, "Largest radius in m");
  const time = number("refine-time", 30);
  const enable = () => {
    box.disabled = !centers.input.checked;
    least.disabled = most.disabled = !radii.input.checked;
  };
  for (const one of [centers, radii]) one.input.addEventListener("change", enable);
  enable();
  const read = () => ({
    vary: ["phases", ...(centers.input.checked ? ["centers"] : []), ...(radii.input.checked ? ["radii"] : [])],
    time_limit_s: time.valueAsNumber,
    ...(centers.input.checked ? { center_box_m: box.valueAsNumber } : {}),
    ...(radii.input.checked ? { radius_m: [least.valueAsNumber, most.valueAsNumber] } : {}),
    ...(objective.value ? { objective: objective.value } : {}),
  });
  return new RequestForm("refinement", "Refine", "Move phases, centres and radii to improve the plan.", {
    fields: { time_limit_s: time, center_box_m: box, radius_m: least, "radius_m[1]": most },
    read,
    rows: [
      wide("Objective", objective),
      element("p", {}, "Move phases and"),
      element("div", { class: "row" }, centers.label, amount(box, "m")),
      faultOf(box),
      element("div", { class: "row" }, radii.label, amount(least, "to", most, "m")),
      faultOf(least),
      faultOf(most),
      labelled("Time limit (s)", time),
    ],
    handIn,
    suited: roomOf,
  });
}

/** How far refinement may go by default: what the scenario says, else shares of the team's radii. */
function roomOf(scenario) {
  const radii = vehiclesOf(scenario).map((one) => one.radius);
  const mean = radii.reduce((sum, one) => sum + one, 0) / radii.length;
  const { center_box_m: box, radius_m: asked } = scenario.refine || {};
  const [least, most] = asked || [RADIUS_SHARES[0] * Math.min(...radii), RADIUS_SHARES[1] * Math.max(...radii)];
  return { center_box_m: box || tidy(BOX_SHARE * mean), radius_m: asked ? least : tidy(least), "radius_m[1]": asked ? most : tidy(most) };
}

/** A number of two digits, as people would type it. */
function tidy(value) {
  return Number(value.toPrecision(2));
}

/** The form of a validation; `size()` returns the number of vehicles. */
export function validationForm(size, handIn) {
  const trials = number("validate-trials", 200);
  const seed = number("validate-seed", 1);
  const read = () => ({
    trials: trials.valueAsNumber,
    seed: seed.valueAsNumber,
    series: size() <= SERIES_LIMIT,
  });
  return new RequestForm(
    "validation",
    "Validate",
    "Simulate the plan many times with the filter and compare its errors with the prediction.",
    { fields: { trials, seed }, read, rows: [labelled("Trials", trials), labelled("Seed", seed)], handIn },
  );
}

export function number(id, value, label) {
  const about = { "aria-label": label, "aria-describedby": `${id}-fault` };
  return element("input", { id, type: "number", step: "any", value, ...about });
}

function check(id, text, checked) {
  const input = element("input", { id, type: "checkbox", checked });
  return { input, label: element("label", { for: id, class: "check" }, input, ` ${text}`) };
}

/** Numbers and their unit, on one line whatever the width. */
function amount(...parts) {
  return element("span", { class: "amount" }, ...parts);
}

function faultOf(input) {
  return element("p", { class: "fault", id: `${input.id}-fault` });
}

/** A choice among texts by their values. */
export function choice(id, texts) {
  const options = Object.entries(texts).map(([value, text]) => element("option", { value }, text));
  return element("select", { id, "aria-describedby": `${id}-fault` }, ...options);
}

/** An input below its label, where one beside it has no room. */
export function wide(text, input) {
  const row = labelled(text, input);
  row.classList.add("wide");
  return row;
}

export function labelled(text, input) {
  return element("div", { class: "field" }, element("label", { for: input.id }, text), input, faultOf(input));
}
