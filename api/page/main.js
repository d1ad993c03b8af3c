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
// what is not needed for the first look at the map comes after it
const around = import("./panels.js").then(({ makePanels }) => makePanels({ store, map, address, opening }));
// over a slow line, the typeface would keep the map waiting
around.then(() => document.fonts.add(new FontFace("Inter", `url(${new URL("./vendor/inter.woff2", import.meta.url)})`, { weight: "100 900", display: "swap" })));
addEventListener("popstate", () => attempt(goTo));
attempt(start);

async function start() {
  const { plan, job, design } = Address.asked;
  const begins = !plan && !(await opening.edit());
  if (begins) await opening.example(FIRST_EXAMPLE);
  else if (plan && !(await openLinked(plan))) return;
  if (plan || !begins) recallHistory(store);
  performance.mark("ready");
  const panels = await around;
  if (begins) isFirstVisit() ? panels.greet() : panels.offerLeft();
  if (job) panels.resumeJob(job);
  if (design) panels.resumeDesign(design, !job);
}

/** Open the plan that the address names; resolves with whether there is one. */
async function openLinked(planId) {
  try {
    await opening.plan(planId);
    return true;
  } catch (error) {
    if (!(error instanceof NoPlan)) throw error;
    if (!store.scenario) {
      (await around).showDeadLink();
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
  if (!plan) {
    store.undo();
    return;
  }
  await openLinked(plan);
  if (job && !address.followed) (await around).resumeJob(job);
}
