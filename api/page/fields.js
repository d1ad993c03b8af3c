// Labelled inputs, each known by a key and by the path of its value, and what is wrong with them.

import { element, mark } from "./elements.js";

const HALF_TYPED = "is no JSON yet: write polygons as [[[x, y], [x, y], [x, y]]]";

/** A group of fields: `{ path, label, unit, kind, min, key, help }`; the key is the path where none is given. */
export class Fields {
  #inputs = new Map();

  /** Return a label, its input and the place for its fault; `changed` hears each new value.
   * @param {{path: string, label: string, unit?: string, kind?: string, min?: number, help?: string, key?: string}} field
   * @param {(value: any) => void} changed */
  add({ path, label, unit, kind, min, help, key = path }, changed) {
    const id = `field-${key.replaceAll(/[^a-z0-9]+/gi, "-")}`;
    const input = kind === "choice" ? element("select", {}) : element("input", typed(kind, min));
    input.id = id;
    if (help) input.title = help;
    input.setAttribute("aria-describedby", `${id}-fault`);
    input.addEventListener(kind === "choice" ? "change" : "input", () => {
      const value = read(input, kind);
      if (kind === "json") mark(input, value === null ? HALF_TYPED : "");
      if (value !== null) changed(value);
    });
    this.#inputs.set(key, { input, path });
    return element(
      "div",
      { class: kind ? "field wide" : "field" },
      element("label", { for: id }, label, unit ? element("span", { class: "unit" }, ` (${unit})`) : null),
      input,
      element("p", { class: "fault", id: `${id}-fault` }),
    );
  }

  /** Forget all fields: others take their place. */
  clear() {
    this.#inputs.clear();
  }

  get keys() {
    return [...this.#inputs.keys()];
  }

  /** Show a value, unless it is what people are typing just now. */
  put(key, value) {
    const { input } = this.#inputs.get(key);
    if (document.activeElement === input) return;
    const listed = Array.isArray(value) && input.dataset.kind !== "json";
    const text = value === undefined || value === null || listed ? "" : asText(value);
    if (input.value !== text) input.value = text;
    input.placeholder = listed ? "differs" : "";
  }

  /** Offer choices, `{ value: text }`, and show which of them is taken. */
  choose(key, choices, value) {
    const { input } = this.#inputs.get(key);
    const offered = [...input.options].map((one) => one.value).join();
    if (offered !== Object.keys(choices).join()) {
      input.replaceChildren(...Object.entries(choices).map(([one, text]) => element("option", { value: one }, text)));
    }
    input.value = value;
  }

  unmark() {
    for (const { input } of this.#inputs.values()) mark(input, "");
  }

  /** Return the input whose path a test holds of. */
  find(test) {
    return [...this.#inputs.values()].find((one) => test(one.path))?.input;
  }
}

function asText(value) {
  return Array.isArray(value) ? JSON.stringify(value) : String(value);
}

function typed(kind, min) {
  if (kind === "json") return { type: "text", spellcheck: "false", "data-kind": "json" };
  return kind === "text" ? { type: "text" } : { type: "number", step: "any", min };
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
