// What can be asked of a plan: forms, those of studies by their options, and that of a refinement.

import { alert, byId, element, folded, mark, options } from "./elements.js";
import { mean, rounded, vehiclesOf } from "./scenario.js";
import { OBJECTIVES } from "./tables.js";

/** so many vehicles have figures over time */
const SERIES_LIMIT = 24;
const SERIES = "series";
/** how far refinement may go by default, in shares of the radii */
const BOX_SHARE = 0.25;
const RADIUS_SHARES = [0.75, 1.25];
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
    const counted = this.#inputs.filter((input) => !input.disabled);
    return Object.fromEntries(counted.map((input) => [input.name, inputValue(input)]));
  }

  /** Whether every number that counts is one; the others are marked. */
  #whole() {
    const missing = this.#inputs.filter((input) => !input.disabled && Number.isNaN(inputValue(input)));
    for (const input of missing) mark(input, "is missing or not a number");
    missing[0]?.focus();
    return missing.length === 0;
  }
}

/** The form of a refinement. */
export function refinementForm({ name, sentence }, handIn) {
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
  made.querySelector(".hint").textContent = sentence;
  made.addEventListener("change", enable);
  enable();
  return new RequestForm(name, made, { read, handIn, suited: roomOf });
}

/** How far refinement may go by default: what the scenario says, else shares of the team's radii. */
function roomOf(scenario) {
  const radii = vehiclesOf(scenario).map((one) => one.radius);
  const { center_box_m: box, radius_m: asked } = scenario.refine || {};
  const [least, most] = asked || [rounded(RADIUS_SHARES[0] * Math.min(...radii), 2), rounded(RADIUS_SHARES[1] * Math.max(...radii), 2)];
  return { center_box_m: box || rounded(BOX_SHARE * mean(radii), 2), radius_m: least, "radius_m[1]": most };
}

/** The form of a study, made of its options; `size()` returns the number of vehicles. Unchanged options are omitted;
 * fields that are rarely used are made when **More options** opens. */
export function studyForm({ name, verb, sentence, options: offered }, size, handIn) {
  const deed = `${verb[0].toUpperCase()}${verb.slice(1)}`;
  const fieldsOf = (wanted) => wanted.flatMap((option) => optionField(verb, option));
  // figures over time are drawn beside the map: whether there are any depends on the team
  const known = offered.filter(({ key, kind }) => kind in INPUTS && key !== SERIES);
  const series = () => (offered.some(({ key }) => key === SERIES) ? { [SERIES]: size() <= SERIES_LIMIT } : {});
  const [first, further] = [true, false].map((often) => known.filter((option) => option.often === often));
  const more = further.length > 0 && folded(MORE);
  if (more) {
    more.addEventListener("toggle", () => more.append(...fieldsOf(further)), { once: true });
    more.addEventListener("input", () => {
      const set = further.filter((option) => askedOf(option, inputValue(byId(`${verb}-${option.key}`))) !== null).length;
      more.firstElementChild.textContent = set ? `${MORE}, ${set} set` : MORE;
    });
  }
  const submit = element("button", { type: "submit", class: "primary", disabled: true }, deed);
  const made = element("form", { class: "task", novalidate: true, "aria-label": deed }, element("p", { class: "hint" }, sentence), fieldsOf(first), more, submit);
  byId("work").append(made);
  const read = (values) => {
    const asked = known.map((option) => [option.key, askedOf(option, values[option.key] ?? null)]);
    return { ...series(), ...Object.fromEntries(asked.filter(([, value]) => value !== null)) };
  };
  return new RequestForm(name, made, { read, handIn });
}

/** What a value asks for an option; null for nothing but its default. */
function askedOf({ kind, default: usual }, value) {
  const asked = value === null ? null : INPUTS[kind].read(value);
  return asked === usual ? null : asked;
}

const MORE = "More options";
const NUMBER = { type: "number", step: "any" };
const TEXT = { type: "text", autocomplete: "off", spellcheck: "false" };

/** Kinds of options that a form has inputs for: their attributes, and the value that they stand for, null for none. */
const INPUTS = {
  integer: { attributes: NUMBER, read: (value) => value },
  number: { attributes: NUMBER, read: (value) => value },
  flag: { attributes: { type: "checkbox" }, read: (value) => value },
  choice: { attributes: {}, wide: true, read: (value) => value || null },
  names: { attributes: TEXT, wide: true, read: (text) => (text.trim() ? listed(text) : null) },
  // what is no number is for the service to refuse
  pair: { attributes: TEXT, read: (text) => (text.trim() ? listed(text).map(Number) : null) },
};

/** The field of an option; an input that may stay empty has a placeholder. */
function optionField(verb, { key, label, unit, sentence, kind, default: usual, choices, example }) {
  const { attributes, wide } = INPUTS[kind];
  const id = `${verb}-${key}`;
  const about = `${id}-hint`;
  const flag = kind === "flag";
  const value = flag ? null : Array.isArray(usual) ? usual.join(", ") : usual;
  const empty = Array.isArray(example) ? `such as ${example.join(", ")}` : "not given";
  const placeholder = !flag && (value === null || value === "") ? empty : null;
  const input =
    kind === "choice"
      ? element("select", { id, name: key }, options(Object.fromEntries(choices.map((choice) => [choice, choice]))))
      : element("input", { id, name: key, ...attributes, value, placeholder, checked: flag && usual });
  if (kind === "choice" && value) input.value = value;
  input.setAttribute("aria-describedby", about);
  const named = element("label", { for: id }, unit ? `${label} (${unit})` : label);
  return [element("div", { class: wide ? "field wide" : "field" }, named, input), element("p", { class: "hint", id: about }, `${sentence.replace(/\.$/, "")}.`)];
}

/** The value of an input; NaN where it is no number, null where it may stay empty and does. */
function inputValue(input) {
  if (input.type === "checkbox") return input.checked;
  if (input.type !== "number") return input.value;
  return input.placeholder && input.value === "" && !input.validity.badInput ? null : input.valueAsNumber;
}

/** What a text lists, between commas or spaces. */
export function listed(text) {
  return text.split(/[\s,;]+/).filter(Boolean);
}
