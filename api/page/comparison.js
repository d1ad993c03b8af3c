// A plan drawn beside the one on show: the worst errors of both, and what ends the comparison.

import { button, byId, element, shown } from "./elements.js";
import { worstOf } from "./trace.js";

/** Return what draws a plan beside a store's plan, with a chip on the map as long as it is there. */
export function offerComparison(store) {
  const words = element("span", { role: "status" });
  const chip = element("div", { class: "comparison" }, words, button("End comparison", () => store.compare(null), { class: "small" }));
  /** @type {any} */
  let compared = null;
  store.on(["beside", "opened", "plan"], ({ quick }) => {
    // what a refinement draws beside the plan is another one
    if (!compared || store.beside !== compared) return chip.remove();
    if (quick) return;
    const [there, here] = [compared, store.plan].map((plan) => shown(worstOf(plan), "m"));
    words.textContent = `Dashed: ${compared.scenario.name || "the other plan"}, worst error ${there}; here ${here}`;
    if (!chip.isConnected) byId("map").append(chip);
  });
  return (plan) => {
    compared = plan;
    store.compare(plan);
  };
}
