// The link to the plan on show.

import { byId, notice } from "./elements.js";
import { ask } from "./service.js";

/** The button that copies a link. `storePlan()` resolves with the identifier of the plan on show;
 * `attempt(task)` does what may fail and says so. */
export function offerLink(store, storePlan, attempt) {
  byId("share").addEventListener("click", () => {
    if (!store.scenario) return;
    attempt(async () => {
      const link = new URL(`?plan=${await keptPlan(store, storePlan)}`, location.origin + location.pathname).href;
      notice(`${(await copied(link)) ? "Link copied" : "Link to this plan"}: ${link}`);
    });
  });
}

/** The identifier of a plan that is there: one that was deleted meanwhile is stored anew. */
async function keptPlan(store, storePlan) {
  const { planId } = store;
  if (!planId) return storePlan();
  try {
    await ask("GET", `v1/plans/${planId}`);
  } catch (error) {
    // a service that is away says nothing about the plan
    if (error.status !== 404) return planId;
    if (store.planId === planId) store.deleted(error);
  }
  return storePlan();
}

/** Whether a text is in the clipboard now: there may be none, or no leave to write to it. */
async function copied(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    return false;
  }
}
