// Plans of the scenario being edited: one request at a time, always of the latest edit.

import { orbitsOf } from "./scenario.js";
import { askJson, passing, pause, Refusal } from "./service.js";

const SETTLE_MS = 350;
const AWAY_S = 2;

/** Keeps a store's plan up with its scenario.
 *
 * While people drag, quick plans are asked for (the map alone, and no errors predicted); once they
 * pause, the whole plan on paper, and then its flights, which the next edit ends. `busy(flag)` hears
 * when there is something to wait for.
 */
export class Planner {
  /** the figures that plans come with: none while figures are closed @type {string[]} */
  static figures = [];
  #store;
  #busy;
  /** @type {any} */
  #waiting = null;
  #running = false;
  #timer = 0;
  /** when the latest edit was made */
  #asked = 0;
  #busyShown = false;
  /** @type {AbortController | null} */
  #flights = null;
  /** @type {any} */
  #flying = null;

  constructor(store, busy) {
    this.#store = store;
    this.#busy = busy;
    store.on(["scenario"], (detail) => this.#ask(detail.live));
    store.on(["plan"], ({ quick, flown, current }) => !quick && !flown && current && this.#fly());
    store.on(["opened"], () => this.#flights?.abort());
  }

  /** Resolves with the plan and figures of a stored plan. */
  static async stored(planId) {
    const at = `v1/plans/${encodeURIComponent(planId)}`;
    const names = Planner.figures;
    const asked = names.map((name) => askJson("GET", `${at}/figures/${name}?theme=${theme()}`));
    const [plan, ...found] = await Promise.all([askJson("GET", at), ...asked]);
    return { plan: await judgedPlan(plan), figures: Object.fromEntries(names.map((name, k) => [name, found[k]])) };
  }

  /** Resolves with the plan and figures of any scenario or plan document, stored nowhere.
   * @param {any} document
   * @param {{figures?: string[], quick?: boolean, paper?: boolean, signal?: AbortSignal}} how */
  static preview(document, { figures = Planner.figures, quick = false, paper = true, signal } = {}) {
    const asked = new URLSearchParams({ quick: `${quick}`, paper: `${paper}`, theme: theme() });
    for (const name of figures) asked.append("figure", name);
    const text = typeof document === "string";
    return askJson("POST", `v1/previews?${asked}`, {
      body: text ? document : JSON.stringify(document),
      type: text ? "application/yaml" : "application/json",
      signal,
    });
  }

  #ask(live) {
    this.#tellBusy(true);
    clearTimeout(this.#timer);
    this.#timer = live ? setTimeout(() => this.#ask(false), SETTLE_MS) : 0;
    this.#flights?.abort();
    this.#asked = performance.now();
    this.#waiting = { subject: this.#store.subject, live };
    if (!this.#running) this.#run();
  }

  /** Fly the plan on show, if it is a GO on paper that no file keeps. */
  #fly() {
    const { subject, plan } = this.#store;
    const { go, basis, findings } = plan.verdict;
    const flies = go && basis?.kind === "paper" && !findings.some((finding) => finding.code === "not-flown");
    if (!flies || subject.planId || this.#waiting || this.#flying === subject.scenario) return;
    this.#tellBusy(true);
    this.#waiting = { subject, live: false, flown: true };
    if (!this.#running) this.#run();
  }

  async #run() {
    this.#running = true;
    while (this.#waiting) {
      const { subject, live, flown = false } = this.#waiting;
      const asked = this.#asked;
      const { scenario } = subject;
      this.#waiting = null;
      try {
        const found = await (flown ? this.#flown(subject) : this.#find(subject, live));
        // a plan opened meanwhile is not to be overwritten by an older edit
        if (this.#store.scenario !== scenario && (flown || !this.#waiting)) continue;
        this.#store.judged(found.plan, found.figures, { quick: live, flown, again: found.again, scenario });
        const measured = live ? "moved to verdict" : flown ? "edited to flown" : "edited to verdict";
        requestAnimationFrame(() => performance.measure(measured, { start: asked }));
      } catch (error) {
        // the verdict on paper stays
        if (flown || error.name === "AbortError") continue;
        this.#store.faulty(faultsOf(error, subject), error.message, whyOf(error));
        if (!passing(error)) continue;
        await pause(AWAY_S);
        // once the service is back, the latest edit is planned
        if (this.#store.scenario === scenario) this.#waiting ??= { subject, live: false };
      }
    }
    this.#running = false;
    this.#tellBusy(this.#timer !== 0);
  }

  /** The plan of a subject: as stored, if it is, and otherwise made. */
  async #find({ document, planId }, live) {
    if (planId) {
      try {
        return { ...(await Planner.stored(planId)), again: true };
      } catch (error) {
        if (error.status !== 404) throw error;
        if (this.#store.planId === planId) this.#store.deleted(error);
      }
    }
    return Planner.preview(document, live ? { figures: [], quick: true } : {});
  }

  /** The plan of a subject with its flights. */
  async #flown({ document, scenario }) {
    this.#flights = new AbortController();
    this.#flying = scenario;
    try {
      return await Planner.preview(document, { paper: false, signal: this.#flights.signal });
    } finally {
      this.#flying = null;
    }
  }

  #tellBusy(flag) {
    if (flag !== this.#busyShown) this.#busy(flag);
    this.#busyShown = flag;
  }
}

/** A stored plan with its verdict: one from before there were verdicts is judged now, its orbits kept. */
async function judgedPlan(plan) {
  if (plan.verdict) return plan;
  const { scenario } = plan;
  const { plan: judged } = await Planner.preview({ scenario, vehicles: orbitsOf(plan) }, { figures: [] });
  return { ...plan, verdict: judged.verdict };
}

/** The faults of a refusal by their paths in the scenario, also where a plan document was sent. */
function faultsOf(error, { document, scenario }) {
  if (!(error instanceof Refusal)) return [];
  if (document === scenario) return error.faults;
  return error.faults.map((one) => ({ ...one, path: one.path.replace(/^scenario\./, "") }));
}

function whyOf(error) {
  if (error.status === 401) return "key";
  return passing(error) ? "away" : "fault";
}

export function theme() {
  return matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
}
