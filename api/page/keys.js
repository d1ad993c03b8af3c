// The key that a service may ask for: entered, refused in words, changed.

import { byId, mark } from "./elements.js";
import { key } from "./service.js";

/** what a header can carry, and keys have */
const SIGNS = /^[!-~]+$/;

/** Ask for a key whenever the service wants one; `entered()` hears of each new one. */
export function askForKeys(entered) {
  const form = byId("key-form");
  const input = byId("key");
  const change = byId("change-key");
  const keep = byId("keep-key");

  function ask(text, { may = false } = {}) {
    form.hidden = false;
    change.hidden = true;
    keep.hidden = !may;
    mark(input, text);
    input.focus();
  }

  function close() {
    form.hidden = true;
    change.hidden = !key.get();
    input.value = "";
  }

  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const given = input.value.trim();
    const wrong = wrongWith(given);
    mark(input, wrong);
    if (wrong) {
      input.focus();
      return;
    }
    key.set(given);
    close();
    byId("menu").focus();
    entered();
  });
  keep.addEventListener("click", () => {
    close();
    byId("menu").focus();
  });
  change.addEventListener("click", () => ask("", { may: true }));
  document.addEventListener("syncplan:key", () => ask(key.get() ? "This key is not known to the service." : ""));
  change.hidden = !key.get();
}

/** What makes a text no key, in words; empty where nothing does. */
function wrongWith(text) {
  if (!text) return "Enter the key that the operator of this service gave you.";
  if (SIGNS.test(text)) return "";
  const place = [...text].findIndex((one) => !SIGNS.test(one));
  const code = [...text][place].codePointAt(0).toString(16).toUpperCase().padStart(4, "0");
  return `A key has no blanks and no letters beyond ASCII; character ${place + 1} is U+${code}, which may be invisible. Copy the key again.`;
}
