// A plan drawn beside the one on show: the worst errors of both, and what ends the comparison.

import { chip, shown } from "./elements.js";
import { worstOf } from "./trace.js";

/** Return what draws a plan beside a store's plan, with a line on the map as long as it is there. */
export function offerComparison(store) {
  const line = chip("End comparison", () => store.compare(null));
  /** @type {any} */
  let compared = null;
  store.on(["beside", "opened", "plan"], ({ quick }) => {
    // what a refinement draws beside the plan is another one
    if (!compared || store.beside !== compared) return line.hide();
    if (quick) return;
    const [there, here] = [compared, store.plan].map((plan) => `worst error ${shown(worstOf(plan), "m")} of ${plan.vehicles.length}`);
    line.say(`Dashed: ${compared.scenario.name || "the other plan"}, ${there} vehicles; here ${here}`);
  });
  return (plan) => {
    compared = plan;
    store.compare(plan);
  };
}
