// Unsaved work of closed tabs, offered at the next visit.

import { attempt, button, byId, element, notice, timeOf } from "./elements.js";
import { discard } from "./session.js";

/** Offer the first of some works over the map, until another scenario is opened or edited; once it is discarded, the next.
 * `open(work)` resolves with whether it could be opened.
 * @param {any} store
 * @param {any[]} works
 * @param {(work: any) => Promise<boolean>} open */
export function offerUnsaved(store, [work, ...others], open) {
  if (!work) return;
  const { name } = work.scenario ?? work.state.scenario;
  const end = (words) => {
    discard(work);
    card.remove();
    notice(words);
    offerUnsaved(store, others, open);
  };
  const takeUp = () => attempt(async () => (await open(work)) || end("This work of an older page can't be opened any more."));
  const words = element("p", {}, "Unsaved when its tab was closed: ", element("strong", {}, name || "a team without a name"), `, ${timeOf(work.at)}`);
  const buttons = element("div", { class: "row" }, button("Continue", takeUp, { class: "primary" }), button("Discard", () => end("")));
  const card = element("section", { class: "card welcome unsaved", "aria-label": "Unsaved work" }, words, buttons);
  for (const event of ["opened", "scenario"]) store.addEventListener(event, () => card.remove(), { once: true });
  byId("map").append(card);
}
