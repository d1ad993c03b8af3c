// Plans of the scenario being edited: one request at a time, always of the latest edit.

import { askJson, passing, pause, Refusal } from "./service.js";

const SETTLE_MS = 350;
const AWAY_S = 2;
const LIVE = ["formation"];

/** The figures that every plan on show has. */
export const PLAN_FIGURES = ["formation", "timeline", "spectrum", "prediction"];

/** Keeps a store's plan up with its scenario.
 *
 * While people drag, quick plans are asked for (no bound on the margin, the map alone); once they
 * pause, the whole plan. `busy(flag)` tells when there is something to wait for.
 */
export class Planner {
  #store;
  #busy;
  #waiting = null;
  #running = false;
  #timer = 0;
  #told = false;

  constructor(store, busy) {
    this.#store = store;
    this.#busy = busy;
    store.addEventListener("scenario", (event) => this.#ask(event.detail.live));
  }

  /** Resolves with the plan and figures of any scenario, stored nowhere. */
  static preview(scenario, { figures = PLAN_FIGURES, quick = false } = {}) {
    const asked = new URLSearchParams({ quick, theme: theme() });
    for (const name of figures) asked.append("figure", name);
    const text = typeof scenario === "string";
    return askJson("POST", `v1/previews?${asked}`, {
      body: text ? scenario : JSON.stringify(scenario),
      type: text ? "application/yaml" : "application/json",
    });
  }

  #ask(live) {
    this.#tellBusy(true);
    clearTimeout(this.#timer);
    this.#timer = live ? setTimeout(() => this.#ask(false), SETTLE_MS) : 0;
    this.#waiting = { scenario: this.#store.scenario, live, asked: performance.now() };
    if (!this.#running) this.#run();
  }

  async #run() {
    this.#running = true;
    while (this.#waiting) {
      const { scenario, live, asked } = this.#waiting;
      this.#waiting = null;
      const options = live ? { figures: LIVE, quick: true } : {};
      try {
        const found = await Planner.preview(scenario, options);
        // a plan opened meanwhile is not to be overwritten by an older edit
        if (this.#store.scenario !== scenario && !this.#waiting) continue;
        this.#store.judged(found.plan, found.figures, { quick: live });
        const measured = live ? "moved to verdict" : "edited to verdict";
        requestAnimationFrame(() => performance.measure(measured, { start: asked }));
      } catch (error) {
        const faults = error instanceof Refusal ? error.faults : [];
        this.#store.faulty(faults, error.message);
        if (!passing(error)) continue;
        await pause(AWAY_S);
        // once the service is back, the latest edit is planned
        if (this.#store.scenario === scenario) this.#waiting ??= { scenario, live: false, asked: performance.now() };
      }
    }
    this.#running = false;
    this.#tellBusy(this.#timer !== 0);
  }

  #tellBusy(flag) {
    if (flag !== this.#told) this.#busy(flag);
    this.#told = flag;
  }
}

export function theme() {
  return matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
}
