// Storing the plan on show, and the link to it.

import { attempt, byId, notice } from "./elements.js";
import { ask, postOnce } from "./service.js";

/** Return what resolves with the identifier of the plan on show, which is stored, once, if it was not. */
export function storing(store, address) {
  /** the scenario that is being stored, and the promise of its identifier */
  let now = null;

  return async () => {
    if (store.planId) return store.planId;
    const { scenario, document } = store;
    if (now?.scenario !== scenario) now = { scenario, planId: keep(scenario, document) };
    try {
      return await now.planId;
    } finally {
      if (now?.scenario === scenario) now = null;
    }
  };

  async function keep(scenario, document) {
    const { id } = await postOnce("v1/plans", document);
    if (store.scenario === scenario) {
      store.stored(id);
      address.write();
    }
    return id;
  }
}

/** The button that stores the plan on show. `storePlan()` resolves with its identifier. */
export function offerSave(store, storePlan) {
  const save = byId("save");
  save.addEventListener("click", () => {
    const { scenario, planId } = store;
    if (!scenario || planId) return;
    attempt(async () => {
      await storePlan();
      notice(scenario.name ? `Saved as ${scenario.name}.` : "Saved.");
    });
  });
  store.on(["opened", "scenario", "plan", "stored"], () => save.setAttribute("aria-disabled", store.planId !== null));
}

/** The button that copies a link. `storePlan()` resolves with the identifier of the plan on show. */
export function offerLink(store, storePlan) {
  byId("share").addEventListener("click", () => {
    if (!store.scenario) return;
    attempt(async () => {
      const link = new URL(`?plan=${await keptPlan(store, storePlan)}`, location.origin + location.pathname).href;
      const done = await copied(link);
      notice(`${done ? "Link copied" : "Link to this plan"}: ${link}`, { asks: !done });
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
