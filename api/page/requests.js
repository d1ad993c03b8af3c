// What can be asked of a plan: forms, and those of a refinement, a validation and a flight.

import { alert, byId, element, mark, options } from "./elements.js";
import { mean, rounded, vehiclesOf } from "./scenario.js";
import { GUIDANCES, OBJECTIVES } from "./tables.js";

/** so many vehicles have figures over time */
const SERIES_LIMIT = 24;
/** how far refinement may go by default, in shares of the radii */
const BOX_SHARE = 0.25;
const RADIUS_SHARES = [0.75, 1.25];
const SEED = 1;
/** What each guidance is called here; the others by their names. */
const STEERING = { track: "keep to the plan", mpc: "look ahead, keep apart", none: "open loop" };

/** A form of the page that hands in a request.
 *
 * Its inputs have the names of the request's keys; what is disabled just now is not looked at. `read(values)` makes the
 * request of their values, `handIn(form, request)` takes it, and `suited(scenario)` returns values that suit a scenario.
 */
export class RequestForm {
  #suited;
  #typed = new Set();
  #rest = alert();

  constructor(kind, made, { handIn, read = (values) => values, suited = (_scenario) => ({}) }) {
    this.kind = kind;
    this.#suited = suited;
    this.element = made;
    this.button = made.querySelector("[type=submit]");
    made.append(this.#rest);
    made.addEventListener("submit", (event) => {
      event.preventDefault();
      this.clear();
      if (this.#whole()) handIn(this, read(this.#values));
    });
    made.addEventListener("input", ({ target }) => this.#typed.add(target.name));
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
  const [box, least, most] = ["refine-box", "refine-least", "refine-most"].map(byId);
  // the first is that of the service, which takes another for large teams: it is not named
  const [first, ...others] = options(OBJECTIVES);
  first.value = "";
  byId("refine-objective").append(first, ...others);
  const enable = () => {
    box.disabled = !byId("refine-centers").checked;
    least.disabled = most.disabled = !byId("refine-radii").checked;
  };
  const read = ({ "radius_m[1]": to, radius_m: from, objective, ...rest }) => ({
    ...rest,
    vary: ["phases", ...(box.disabled ? [] : ["centers"]), ...(most.disabled ? [] : ["radii"])],
    ...(most.disabled ? {} : { radius_m: [from, to] }),
    ...(objective ? { objective } : {}),
  });
  const made = byId("refinement-form");
  made.addEventListener("change", enable);
  enable();
  return new RequestForm("refinement", made, { read, handIn, suited: roomOf });
}

/** How far refinement may go by default: what the scenario says, else shares of the team's radii. */
function roomOf(scenario) {
  const radii = vehiclesOf(scenario).map((one) => one.radius);
  const { center_box_m: box, radius_m: asked } = scenario.refine || {};
  const [least, most] = asked || [rounded(RADIUS_SHARES[0] * Math.min(...radii), 2), rounded(RADIUS_SHARES[1] * Math.max(...radii), 2)];
  return { center_box_m: box || rounded(BOX_SHARE * mean(radii), 2), radius_m: least, "radius_m[1]": most };
}

/** The form of a validation; `size()` returns the number of vehicles. */
export function validationForm(size, handIn) {
  const read = (values) => ({ ...values, series: size() <= SERIES_LIMIT });
  return new RequestForm("validation", byId("validation-form"), { read, handIn });
}

/** The form of a flight; `size()` returns the number of vehicles. */
export function flightForm(size, handIn) {
  const guidance = byId("fly-guidance");
  const explain = () => (byId("fly-guidance-text").textContent = GUIDANCES[guidance.value]);
  guidance.append(...Object.keys(GUIDANCES).map((name) => element("option", { value: name }, STEERING[name] ?? name)));
  guidance.addEventListener("change", explain);
  explain();
  const read = ({ wind_mps: wind, lose, hold, ...rest }) => ({
    ...rest,
    seed: SEED,
    lose: listed(lose),
    hold: listed(hold),
    // what is no number is for the service to refuse
    ...(wind.trim() ? { wind_mps: listed(wind).map(Number) } : {}),
    series: size() <= SERIES_LIMIT,
  });
  return new RequestForm("flight", byId("flight-form"), { read, handIn });
}

/** What a text lists, between commas or spaces. */
export function listed(text) {
  return text.split(/[\s,;]+/).filter(Boolean);
}
