// Labelled inputs of a scenario's values, and what is wrong with them.

import { pairIn } from "./coordinates.js";
import { degreesBeside, element, mark, options } from "./elements.js";
import { scrubbed, stepOf } from "./scrubbing.js";
import { question } from "./terms.js";

const HALF_TYPED = "is no JSON yet";

/**
 * @typedef {object} Field
 * a value of the scenario: `read(scenario)` returns it, `change(scenario, value)` the scenario with another one;
 * of choices, `choices(value)` returns the texts by value, and the one taken; `steady` where no error depends on it;
 * `whole` where it changes once it is typed; `pasted(scenario, pair)` returns the scenario with two numbers that
 * were pasted; `unitOf()` returns a unit that may be another one later; a RangeError of a change is shown at the field
 * @property {string} path
 * @property {string} label
 * @property {string} [unit]
 * @property {() => string} [unitOf]
 * @property {string} [kind] "choice", "text", "json" or "name", which changes once it is whole; a number where it is left out
 * @property {number} [min]
 * @property {number} [max]
 * @property {string} [help]
 * @property {string} [id] the path where none is given
 * @property {boolean} [steady]
 * @property {boolean} [whole]
 * @property {number} [step] of the arrow keys, a tenth of the value's decade where none is given
 * @property {any} [input] its element
 * @property {any} [beside] where its unit is shown
 * @property {(value: any) => [Record<string, string>, any]} [choices]
 * @property {(scenario: any) => any} read
 * @property {(scenario: any, value: any) => any} change
 * @property {(scenario: any, pair: number[]) => any} [pasted]
 */

/** A group of fields of a store's scenario. */
export class Fields {
  #store;
  /** @type {Field[]} */
  #fields = [];

  constructor(store) {
    this.#store = store;
  }

  /** Return a label and its input.
   * @param {Field} given */
  add(given) {
    const { path, label: name, unit, unitOf, kind, help, whole, pasted } = given;
    const id = `field-${(given.id ?? path).replaceAll(/[^a-z0-9]+/gi, "-")}`;
    const input = element(kind === "choice" ? "select" : "input", { id, title: help, ...typed(given) });
    const beside = unit || unitOf ? element("span", { class: "unit" }, unit ? ` (${unit})` : "") : null;
    const field = { ...given, input, beside };
    const edit = (change, how) => {
      try {
        const changed = change(this.#store.scenario);
        if (changed !== this.#store.scenario) this.#store.edit(changed, { live: true, field, ...how });
      } catch (error) {
        if (!(error instanceof RangeError)) throw error;
        mark(input, error.message);
      }
    };
    const take = ({ detail }) => {
      const value = read(input, kind);
      if (kind === "json") mark(input, value === null ? HALF_TYPED : "");
      if (value === null) return;
      // an input that is scrubbed says more of the edit
      edit((scenario) => field.change(scenario, value), detail);
      if (!kind) fit(field);
    };
    const waits = kind === "choice" || kind === "name" || whole;
    input.addEventListener(waits ? "change" : "input", take);
    // what is scrubbed is whole
    if (waits) input.addEventListener("input", (event) => event instanceof CustomEvent && take(event));
    if (pasted) {
      input.addEventListener("paste", (event) => {
        const pair = pairIn(event.clipboardData.getData("text"));
        if (!pair) return;
        event.preventDefault();
        edit((scenario) => pasted(scenario, pair));
        this.#put(field, field.read(this.#store.scenario));
      });
    }
    this.#fields.push(field);
    const label = element("label", { for: id }, name, beside);
    if (!kind) scrubbed(label, input);
    return element("div", { class: kind ? "field wide" : "field" }, element("span", {}, label, question(name)), input);
  }

  /** Forget all fields: others take their place. */
  clear() {
    this.#fields = [];
  }

  /** Show the values of a scenario, but not in place of what people are typing just now. */
  show(scenario) {
    for (const field of this.#fields) {
      const value = field.read(scenario);
      if (field.unitOf) field.beside.textContent = ` (${field.unitOf()})`;
      if (field.choices) this.#choose(field.input, ...field.choices(value));
      else if (document.activeElement !== field.input) this.#put(field, value);
    }
  }

  /** @param {Field} field
   * @param {any} value */
  #put(field, value) {
    const { input, kind } = field;
    const listed = Array.isArray(value) && kind !== "json";
    const missing = value === undefined || value === null || listed;
    const text = missing ? "" : kind === "json" ? JSON.stringify(value) : String(value);
    if (input.value !== text) input.value = text;
    if (listed || input.placeholder === "differs") input.placeholder = listed ? "differs" : "";
    if (!kind) fit(field);
  }

  /** Offer choices, `{ value: text }`, and show which of them is taken. */
  #choose(input, choices, value) {
    const offered = [...input.options].map((one) => one.value).join();
    if (offered !== Object.keys(choices).join()) input.replaceChildren(...options(choices));
    input.value = value;
  }

  unmark() {
    for (const { input } of this.#fields) mark(input, "");
  }

  /** Return the input whose path a test holds of. */
  find(test) {
    return this.#fields.find((one) => test(one.path))?.input;
  }
}

/** Fit the step of the arrow keys to a field's number, and say it in degrees beside radians. @param {Field} field */
function fit({ input, unit, step, beside }) {
  const value = input.valueAsNumber;
  input.step = step ?? stepOf(value, unit);
  if (unit) beside.textContent = ` (${unit}${degreesBeside(value, unit)})`;
}

/** The attributes of an input by its kind. @param {Field} field */
function typed({ kind, min, max }) {
  if (kind === "choice") return {};
  return kind ? { type: "text", spellcheck: kind === "json" ? "false" : null } : { type: "number", min, max };
}

/** What JSON text holds; null while it is half typed. */
function parsed(text) {
  try {
    return JSON.parse(text);
  } catch {
    return null;
  }
}

/** The value of an input; null while a number is half typed, "" where it was emptied. */
function read(input, kind) {
  if (kind === "json" && input.value.trim() !== "") return parsed(input.value);
  if (kind) return input.value;
  if (input.value === "") return input.validity.badInput ? null : "";
  return input.valueAsNumber;
}
