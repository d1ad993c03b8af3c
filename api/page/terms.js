// Terms that explain themselves where they stand: buttons that open what they mean.

import { element } from "./elements.js";
import { TERMS } from "./tables.js";

const MEANINGS = new Map(Object.entries(TERMS).map(([form, meaning]) => [form.toLowerCase(), meaning]));
const FORMS = new RegExp(`\\b(${[...MEANINGS.keys()].sort((one, other) => other.length - one.length).join("|")})\\b`, "i");

/** Return a text, to be put in an element: the terms in it are buttons. */
export function explained(text) {
  return text.split(FORMS).map((part, k) => (k % 2 ? termOf(part, part) : part));
}

/** Return a button that explains the term in the text of a label, null where there is none. */
export function question(text) {
  const [, term] = text.split(FORMS);
  return term ? termOf(term, "?", element("span", { class: "unseen" }, ` What is “${term.toLowerCase()}”?`)) : null;
}

function termOf(term, ...shown) {
  const button = element("button", { type: "button", class: "term" }, ...shown);
  // the browser opens and closes it, by this button, Escape or a click elsewhere; it takes the focus and gives it back
  button.addEventListener("click", () => {
    if (button.popoverTargetElement) return;
    const note = element("span", { popover: "auto", class: "meaning", role: "note", tabindex: "-1", autofocus: true }, MEANINGS.get(term.toLowerCase()));
    note.addEventListener("toggle", (event) => event.newState === "closed" && note.remove());
    button.after(note);
    button.popoverTargetElement = note;
  });
  return button;
}
