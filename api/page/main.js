// The page: the map first, then all that is around it.

import { Address } from "./address.js";
import { attempt, busy } from "./elements.js";
import { askForKeys } from "./keys.js";
import { FormationMap } from "./map.js";
import { FIRST_EXAMPLE, Opening } from "./opening.js";
import { Planner } from "./planner.js";
import { NoPlan } from "./service.js";
import { isFirstVisit, keepOverReloads, recallHistory } from "./session.js";
import { Store } from "./store.js";

const store = new Store();
const map = new FormationMap(store);
const address = new Address(store);
const opening = new Opening(store, address, () => map.fit());
new Planner(store, busy);
keepOverReloads(store);
askForKeys(() => {
  // an edit that waits for the key is not lost to the first example
  if (store.scenario) store.edit(store.scenario, { step: false });
  else attempt(start);
});
addEventListener("popstate", () => attempt(goTo));
/** @type {Promise<any> | undefined} */
let around;
attempt(start).finally(panels);
// a slow service must not keep them waiting
setTimeout(panels, 500);

/** Return what is around the map, which is loaded after its first plan. */
function panels() {
  around ??= import("./panels.js").then(({ makePanels }) => makePanels({ store, map, address, opening }));
  return around;
}

async function start() {
  const { plan, job, design } = Address.asked;
  const begins = !plan && !(await opening.edit());
  if (begins) await opening.example(FIRST_EXAMPLE);
  else if (plan && !(await openLinked(plan))) return;
  if (plan || !begins) recallHistory(store);
  performance.mark("ready");
  const { greet, offerLeft, resumeJob, resumeDesign } = await panels();
  if (begins) isFirstVisit() ? greet() : offerLeft();
  if (job) resumeJob(job);
  if (design) resumeDesign(design, !job);
}

/** Open the plan that the address names; resolves with whether there is one. */
async function openLinked(planId) {
  try {
    await opening.plan(planId);
    return true;
  } catch (error) {
    if (!(error instanceof NoPlan)) throw error;
    if (!store.scenario) {
      (await panels()).showDeadLink();
      return false;
    }
    // beside a plan on show, a message will do
    address.write();
    throw error;
  }
}

/** Show what the address names, after Back or Forward. */
async function goTo() {
  const { plan, job } = Address.asked;
  // a jump within the page comes here as well
  if ((plan ?? null) === store.planId) return;
  if (!plan) return store.undo();
  await openLinked(plan);
  if (job && !address.followed) (await panels()).resumeJob(job);
}
