// Keys that editors have: undo, redo, select all, copy, delete, and a letter for each tool.

import { byId } from "./elements.js";
import { bodiesOf } from "./grips.js";
import { copyChosen, removeChosen } from "./selection.js";

const TYPED = ["text", "number", "password", "search"];

/** Listen for the keys of a store and a map's tools, unless text is being typed, which browsers undo themselves. */
export function listenForKeys(store, tools) {
  const held = {
    z: (shift) => (shift ? store.redo() : store.undo()),
    y: () => store.redo(),
    a: () => store.selectAll(bodiesOf(store.scenario, null).map(({ kind, k }) => ({ kind, k }))),
    d: () => copyChosen(store),
  };
  document.addEventListener("keydown", (event) => {
    if (event.altKey || isTyping(event.target) || !store.scenario) return;
    const letter = event.key.toLowerCase();
    const onMap = event.target === document.body || byId("map").contains(event.target);
    if (event.ctrlKey || event.metaKey) {
      // all and copy mean something else where there is text
      if (!(letter in held) || ("ad".includes(letter) && !onMap)) return;
      event.preventDefault();
      held[letter](event.shiftKey);
    } else if (event.key === "Escape") tools.take("select");
    else if (!onMap) return;
    else if (event.key === "Delete" || event.key === "Backspace") removeChosen(store);
    else tools.key(letter);
  });
}

function isTyping(target) {
  return target.isContentEditable || target instanceof HTMLTextAreaElement || (target instanceof HTMLInputElement && TYPED.includes(target.type));
}
