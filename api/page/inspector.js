// The parts of the plan beside the map, one on show at a time; on a phone they are a sheet below it.

import { byId } from "./elements.js";
import { tabs } from "./tabs.js";

const PARTS = { scenario: "Scenario", verdict: "Verdict", run: "Run", design: "Design", export: "Export" };

/** Let parts be chosen and the sheet be opened; what is selected on the map shows its fields. Returns `{ choose(name) }`. */
export function offerParts(store) {
  const parts = tabs(byId("parts"), PARTS, (name) => {
    for (const other of Object.keys(PARTS)) byId(`part-${other}`).hidden = other !== name;
  }, (name) => `part-${name}`);
  parts.show(Object.keys(PARTS));
  const sheet = byId("sheet");
  sheet.addEventListener("click", () => {
    const open = sheet.getAttribute("aria-expanded") !== "true";
    sheet.setAttribute("aria-expanded", open);
    sheet.textContent = open ? "Map" : "Details";
  });
  store.on(["selected"], () => store.selected && parts.choose("scenario"));
  return parts;
}
