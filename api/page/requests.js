// What can be asked of a plan: forms, those of studies by their options, and that of a refinement.

import { pairsIn } from "./coordinates.js";
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
 * request of their values and `write(request)` the values of a request, `handIn(form, request)` takes it, and
 * `suited(scenario)` returns values that suit a scenario.
 */
export class RequestForm {
  #suited;
  #write;
  #typed = new Set();
  #rest = alert();

  constructor(kind, made, { handIn, read = (values) => values, write = (_request) => ({}), suited = (_scenario) => ({}) }) {
    this.kind = kind;
    this.#write = write;
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

  /** Put in the values of a request, as after a reload. */
  fill(request) {
    for (const [name, value] of Object.entries(this.#write(request))) {
      const input = this.#inputs.find((field) => field.name === name);
      if (!input || value === undefined || value === null) continue;
      if (input.type === "checkbox") input.checked = value;
      else input.value = [value].flat().join(", ");
      input.dispatchEvent(new Event("input", { bubbles: true }));
    }
  }

  /** Show what is wrong next to the fields it concerns; the first of them has the focus. */
  showFault({ faults = [], message }) {
    const rest = [];
    for (const { path, message: text } of faults) {
      // its input, or the one of the value or the section that the path lies in
      const around = ({ name, disabled }) => !disabled && (name === path || (name && path.startsWith(name) && ".[".includes(path[name.length])));
      const [input] = this.#inputs.filter(around).sort((a, b) => b.name.length - a.name.length);
      if (input) mark(input, input.name === path ? text : `${path}: ${text}`);
      else rest.push(`${path}: ${text}`);
    }
    this.#inputs.find((input) => input.ariaInvalid)?.focus();
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
  const write = ({ vary = [], radius_m: [from, to] = [], ...rest }) => {
    for (const [box, name] of [["refine-centers", "centers"], ["refine-radii", "radii"]]) byId(box).checked = vary.includes(name);
    enable();
    return { ...rest, radius_m: from, "radius_m[1]": to };
  };
  const made = byId("refinement-form");
  made.querySelector(".hint").textContent = sentence;
  made.addEventListener("change", enable);
  enable();
  return new RequestForm(name, made, { read, write, handIn, suited: roomOf });
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
    more.addEventListener("toggle", grow);
    more.addEventListener("input", () => {
      const set = further.filter((option) => askedOf(option, inputValue(byId(`${verb}-${option.key}`))) !== null).length;
      more.firstElementChild.textContent = set ? `${MORE}, ${set} set` : MORE;
    });
  }
  const submit = element("button", { type: "submit", disabled: true }, deed);
  const made = element("form", { class: "task", novalidate: true, "aria-label": deed }, element("p", { class: "hint" }, sentence), fieldsOf(first), more, submit);
  byId("work").append(made);
  function grow() {
    if (more && !byId(`${verb}-${further[0].key}`)) more.append(...fieldsOf(further));
  }
  const write = (request) => {
    if (further.some(({ key }) => key in request)) grow();
    return request;
  };
  const read = (values) => {
    const asked = known.map((option) => [option.key, askedOf(option, values[option.key] ?? null)]);
    return { ...series(), ...Object.fromEntries(asked.filter(([, value]) => value !== null)) };
  };
  return new RequestForm(name, made, { read, write, handIn });
}

/** What a value asks for an option; null for nothing but its default. */
function askedOf({ kind, default: usual }, value) {
  const asked = value === null ? null : INPUTS[kind].read(value);
  return asked === usual ? null : asked;
}

const MORE = "More options";
const NUMBER = { type: "number", step: "any" };
const TEXT = { type: "text", autocomplete: "off", spellcheck: "false" };
const joined = (value) => [value].flat().join(", ");

/** Kinds of options that a form has inputs for: their attributes, the value that they stand for, null for none, and the text of
 * a value, where that is not its own.
 * @type {Record<string, {attributes: Record<string, any>, wide?: boolean, read: (value: any) => any, word?: (value: any) => string}>} */
export const INPUTS = {
  integer: { attributes: NUMBER, read: (value) => value },
  number: { attributes: NUMBER, read: (value) => value },
  flag: { attributes: { type: "checkbox" }, read: (value) => value },
  choice: { attributes: {}, wide: true, read: (value) => value || null },
  names: { attributes: TEXT, wide: true, read: (text) => (text.trim() ? listed(text) : null), word: joined },
  // what is no number is for the service to refuse
  pair: { attributes: TEXT, read: (text) => (text.trim() ? listed(text).map(Number) : null), word: joined },
  // a number by itself, or the least and the largest
  span: { attributes: TEXT, read: (text) => (/[\s,;]/.test(text.trim()) ? listed(text).map(Number) : text.trim() ? Number(text) : null), word: joined },
  places: { attributes: TEXT, wide: true, read: pairsIn, word: (places) => Object.values(places).map(joined).join("; ") },
};

/** The field of an option; an input that may stay empty has a placeholder. */
export function optionField(verb, { key, label, unit, sentence, kind, default: usual, choices, example }) {
  const { attributes, wide, word = String } = INPUTS[kind];
  const id = `${verb}-${key}`;
  const about = sentence && `${id}-hint`;
  const flag = kind === "flag";
  const value = flag || usual === null ? null : word(usual);
  const empty = Array.isArray(example) ? `such as ${word(example)}` : "not given";
  const placeholder = !flag && (value === null || value === "") ? empty : null;
  const input =
    kind === "choice"
      ? element("select", { id, name: key }, options(Object.fromEntries(choices.map((choice) => [choice, choice]))))
      : element("input", { id, name: key, ...attributes, value, placeholder, checked: flag && usual });
  if (kind === "choice" && value) input.value = value;
  if (about) input.setAttribute("aria-describedby", about);
  const named = element("label", { for: id }, unit ? `${label} (${unit})` : label);
  return [element("div", { class: wide ? "field wide" : "field" }, named, input), about && element("p", { class: "hint", id: about }, `${sentence.replace(/\.$/, "")}.`)];
}

/** The value of an input; NaN where it is no number, null where it may stay empty and does. */
export function inputValue(input) {
  if (input.type === "checkbox") return input.checked;
  if (input.type !== "number") return input.value;
  return input.placeholder && input.value === "" && !input.validity.badInput ? null : input.valueAsNumber;
}

/** What a text lists, between commas or spaces. */
export function listed(text) {
  return text.split(/[\s,;]+/).filter(Boolean);
}
