// Keys that editors have: save, undo, redo, select all, copy, delete, and a letter for each tool.

import { byId } from "./elements.js";
import { bodiesOf } from "./grips.js";
import { copyChosen, removeChosen } from "./selection.js";

const TYPED = ["text", "number", "password", "search"];

/** what was copied last: the bodies of Ctrl+C @type {any[]} */
let clipped = [];

/** Listen for the keys of a store and a map's tools, unless text is being typed, which browsers undo themselves. */
export function listenForKeys(store, tools) {
  const held = {
    s: () => {
      const { activeElement: focused } = /** @type {any} */ (document);
      // what is being typed is taken before
      focused.blur();
      byId("save").click();
      focused.focus();
    },
    z: (shift) => (shift ? store.redo() : store.undo()),
    y: () => store.redo(),
    a: () => store.selectAll(bodiesOf(store.scenario, null).map(({ kind, k }) => ({ kind, k }))),
    d: () => copyChosen(store),
    c: () => (clipped = store.chosen),
    v: () => {
      copyChosen(store, clipped);
      // the next one goes beside this one
      clipped = store.chosen;
    },
  };
  document.addEventListener("keydown", (event) => {
    const letter = event.key.toLowerCase();
    const saves = letter === "s" && (event.ctrlKey || event.metaKey);
    if (event.altKey || (isTyping(event.target) && !saves) || !store.scenario) return;
    const onMap = event.target === document.body || byId("map").contains(event.target);
    if (event.ctrlKey || event.metaKey) {
      // all and copy mean something else where there is text
      if (!(letter in held) || ("acdv".includes(letter) && !onMap)) return;
      event.preventDefault();
      held[letter](event.shiftKey);
    } else if (event.key === "Escape") tools.abandon();
    else if (!onMap) return;
    else if (event.key === "Enter" && tools.corners) tools.take("select");
    else if (event.key === "Delete" || event.key === "Backspace") removeChosen(store);
    else tools.key(letter);
  });
}

function isTyping(target) {
  return target.isContentEditable || target instanceof HTMLTextAreaElement || (target instanceof HTMLInputElement && TYPED.includes(target.type));
}
