// A link that leads to no plan: what it says, and the ways on from it.

import { byId } from "./elements.js";
import { kept } from "./session.js";

/** Offer what can be opened in place of a plan that is not there, until something is.
 *
 * `ways` are what the buttons do, `{ edit, example }`. Returns what shows the offer.
 */
export function offerWaysOn(store, { edit, example }) {
  const card = byId("dead-link");
  const open = (flag) => {
    card.hidden = !flag;
    byId("workspace").hidden = flag;
  };
  byId("dead-edit").addEventListener("click", edit);
  byId("dead-example").addEventListener("click", example);
  byId("dead-new").addEventListener("click", () => byId("new").click());
  store.on(["opened"], () => open(false));
  return () => {
    byId("dead-edit").hidden = kept() === null;
    open(true);
    byId("dead-title").focus();
  };
}
