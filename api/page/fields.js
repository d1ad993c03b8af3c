// Labelled inputs, each known by a key and by the path of its value, and what is wrong with them.

import { element, mark } from "./elements.js";

/** A group of fields: `{ path, label, unit, kind, min, key }`; the key is the path where none is given. */
export class Fields {
  #inputs = new Map();

  /** Return a label, its input and the place for its fault; `changed` hears each new value. */
  add({ path, label, unit, kind, min, key = path }, changed) {
    const id = `field-${key.replaceAll(/[^a-z0-9]+/gi, "-")}`;
    const input = kind === "choice" ? element("select", {}) : element("input", typed(kind, min));
    input.id = id;
    input.setAttribute("aria-describedby", `${id}-fault`);
    input.addEventListener(kind === "choice" ? "change" : "input", () => {
      const value = read(input, kind);
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
    const text = value === undefined || value === null || Array.isArray(value) ? "" : String(value);
    if (input.value !== text) input.value = text;
    input.placeholder = Array.isArray(value) ? "differs" : "";
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

function typed(kind, min) {
  return kind === "text" ? { type: "text" } : { type: "number", step: "any", min };
}

/** The value of an input; null while a number is half typed, "" where it was emptied. */
function read(input, kind) {
  if (kind) return input.value;
  if (input.value === "") return input.validity.badInput ? null : "";
  return input.valueAsNumber;
}
