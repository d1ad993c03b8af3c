// Names edited in place: that of the scenario in the bar, those of vehicles and landmarks from the map.

import { byId } from "./elements.js";
import { withValue } from "./scenario.js";

/** Let the names of a store's scenario be edited where they stand. */
export function offerNaming(store) {
  const name = byId("map-name");
  const show = () => (name.textContent = store.scenario?.name ?? "");
  store.on(["opened", "scenario"], () => document.activeElement !== name && show());
  name.addEventListener("keydown", (event) => {
    if (event.key === "Escape") show();
    if (event.key !== "Enter" && event.key !== "Escape") return;
    event.preventDefault();
    name.blur();
  });
  name.addEventListener("blur", () => {
    const text = name.textContent.trim();
    if (store.scenario && text && text !== store.scenario.name) store.edit(withValue(store.scenario, "name", text));
    show();
    name.scrollLeft = 0;
  });
  const handles = byId("handles");
  const rename = ({ target }) => {
    store.select({ kind: target.grip.kind, k: target.grip.k });
    const sheet = byId("sheet");
    if (sheet.checkVisibility() && sheet.getAttribute("aria-expanded") === "false") sheet.click();
    byId("field-chosen-name")?.select();
  };
  handles.addEventListener("dblclick", rename);
  handles.addEventListener("keydown", (event) => event.key === "F2" && rename(event));
}
