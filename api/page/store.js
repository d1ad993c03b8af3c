// What the page knows: the scenario being edited, its plan, and who wants to hear of changes.

import { editable, namesOf, orbitsOf, sameOrbits, sameScenario, withPhase } from "./scenario.js";

const MOST_STEPS = 100;
/** steps that outlast a reload */
const KEPT_STEPS = 20;
const SAME_EDIT_MS = 1000;

/** The page's state.
 *
 * Events: "opened", "scenario" (edited), "plan" (judged), "faults", "selected", "beside", "off", "report", "degrees",
 * "recalled", "stored" (or found deleted).
 *
 * Edits are compared with an anchor, the plan that was opened or stored last: `{ scenario, planId,
 * given, fresh }`, `fresh` where the page itself made it. Its scenario typed in again is that plan again. `given` is `{ vehicles, origin }` where
 * no rule gives its phases; they stay while the orbits and who meets whom do.
 */
export class Store extends EventTarget {
  /** @type {any} */
  scenario = null;
  /** @type {any} */
  plan = null;
  /** what is selected, vehicles, landmarks and polygons, the last one last @type {{kind: string, k: number}[]} */
  chosen = [];
  /** another plan, drawn beside this one, or null @type {any} */
  beside = null;
  /** names of what is switched off on the map, as the service's what-if reads them @type {string[]} */
  off = [];
  /** what the service finds of the plan without it, `{ fault }` where it refuses; null until it answers @type {any} */
  without = null;
  /** identifier of the plan as stored; null while it is an edit not yet stored @type {string | null} */
  planId = null;
  /** orbits that were given and hold for the scenario: `{ vehicles, origin }`, or null @type {any} */
  given = null;
  /** whether positions are shown in degrees, where the scenario has a place on the earth */
  degrees = false;
  /** identifier of the job whose report is on show, or null @type {string | null} */
  report = null;
  /** @type {any} */
  #anchor = null;
  /** details of the events that say what is on show @type {Record<string, any>} */
  #now = {};
  #past = [];
  #future = [];
  /** what was edited last, a name or a field of the form @type {{field: any, at: number}} */
  #last = { field: null, at: 0 };

  /** Call `hear` with the detail of each event of these names; who comes later hears first what was opened and judged.
   * @param {string[]} names
   * @param {(detail: any) => void} hear */
  on(names, hear) {
    for (const name of names) {
      if (name in this.#now) hear(this.#now[name]);
      this.addEventListener(name, (event) => hear(/** @type {CustomEvent} */ (event).detail));
    }
  }

  /** What there is to plan: the scenario, with the orbits that were given. */
  get document() {
    return this.given ? { scenario: this.scenario, vehicles: this.given.vehicles } : this.scenario;
  }

  /** What a plan is asked for with, now. */
  get subject() {
    const { scenario, document, planId } = this;
    return { scenario, document, planId };
  }

  /** The vehicle or landmark that was selected last; null where none is. */
  get selected() {
    return this.chosen[this.chosen.length - 1] ?? null;
  }

  isSelected({ kind, k }) {
    return this.chosen.some((one) => one.kind === kind && one.k === k);
  }

  /** The plan on show with the phases that hold now: an edit may have given others. */
  get drawn() {
    return this.plan && this.given ? { ...this.plan, vehicles: this.given.vehicles } : this.plan;
  }

  /** What brings the present scenario back: itself, and what it is an edit of. */
  get state() {
    return { scenario: this.scenario, anchor: this.#anchor };
  }

  /** Whether the scenario is an edit or a new team whose plan is stored nowhere. */
  get unsaved() {
    if (!this.scenario || this.planId) return false;
    const { scenario, given, fresh } = this.#anchor;
    return fresh || given?.origin === "hand" || !sameScenario(this.scenario, scenario);
  }

  /** Whose phases were lost to an edit that moved orbits or meetings: "refined", ..., or null. */
  get lost() {
    return this.given ? null : (this.#anchor?.given?.origin ?? null);
  }

  /** Take an edit: the plan on show is then of an older scenario until the service answers.
   *
   * Edits of one field that follow each other at once are one step to undo. `phase`, `{ k, phase_rad }`, is that of
   * a vehicle set by hand: all phases are given from then on.
   *
   * @param {any} scenario
   * @param {{live?: boolean, step?: boolean, field?: any, phase?: {k: number, phase_rad: number}}} how
   */
  edit(scenario, { live = false, step = true, field = null, phase } = {}) {
    const at = performance.now();
    const goesOn = field !== null && field === this.#last.field && at - this.#last.at < SAME_EDIT_MS;
    this.#last = { field, at };
    if (step && !goesOn && (phase || !sameScenario(scenario, this.scenario))) this.#remember(this.state);
    const { given } = this;
    // another subject for the planner, though its keys are the same
    if (phase) scenario = { ...scenario };
    const byHand = phase && { scenario, planId: null, given: { vehicles: withPhase(this.drawn, scenario, phase), origin: "hand" } };
    this.#put({ scenario, anchor: byHand || this.#anchor });
    this.#emit("scenario", { live, field, lost: given && !this.given });
  }

  /** Start over with a plan, stored or not, or a `fresh` one; `origin` says where its given phases come from. */
  open({ plan, planId = null, origin = "given", fresh = false }) {
    const scenario = editable(plan);
    const { method } = plan.synchronisation;
    const source = { refined: "refined", given: origin }[method];
    const given = source ? { vehicles: orbitsOf(plan), origin: source } : null;
    this.reopen({ scenario, anchor: { scenario, planId, given, fresh } }, plan);
  }

  /** Start over with a state that was kept, and its plan; what it is an edit of can be undone to. */
  reopen(state, plan) {
    if (this.scenario) this.#remember(this.state);
    const { anchor } = state;
    if (!sameScenario(state.scenario, anchor.scenario)) this.#remember({ scenario: anchor.scenario, anchor });
    this.#put(state);
    Object.assign(this, { plan, chosen: [], beside: null });
    this.#emit("opened");
  }

  /** Show a plan: of the present scenario, or of an older one that an edit has overtaken.
   *
   * `flown` says that only its flights are new, `opened` that it is a stored plan that was opened, and
   * `again` that undo or redo brought it back.
   */
  judged(plan, figures, { quick, flown = false, opened = false, again = false, scenario = this.scenario }) {
    this.plan = plan;
    this.#emit("plan", { figures, quick, flown, opened, again, current: scenario === this.scenario });
  }

  /** Report what is wrong; `why` is "fault", "away" or "key". */
  faulty(faults, message, why) {
    this.#emit("faults", { faults, message, why });
  }

  stored(planId) {
    this.#put({ scenario: this.scenario, anchor: { scenario: this.scenario, planId, given: this.given } });
    this.#emit("stored");
  }

  /** What went wrong in words, if it is that the plan on show was deleted; it is stored anew then. */
  deleted(error) {
    if (error.status !== 404 || !this.planId) return null;
    this.stored(null);
    return "This plan was deleted from the service. Try again to store it anew.";
  }

  reported(jobId) {
    this.report = jobId;
    this.#emit("report");
  }

  /** Select a vehicle or landmark, or nothing; with `more` beside what is selected, or no longer.
   *
   * With `reveal` it comes into view, wherever it is; `dragged` says that a drag selects it.
   * @param {{kind: string, k: number} | null} what */
  select(what, { more = false, reveal = false, dragged = false } = {}) {
    const others = more && what ? this.chosen.filter((one) => one.kind !== what.kind || one.k !== what.k) : [];
    const known = more && what && this.isSelected(what);
    this.chosen = what && !known ? [...others, what] : others;
    this.#emit("selected", { reveal, dragged });
  }

  /** Select all of these, brought into view with `reveal`. */
  selectAll(chosen, { reveal = false } = {}) {
    this.chosen = chosen;
    this.#emit("selected", { reveal });
  }

  /** Draw another plan beside this one; null ends it. */
  compare(plan) {
    this.beside = plan;
    this.#emit("beside");
  }

  /** Show positions in degrees, or in metres. */
  showDegrees(degrees) {
    this.degrees = degrees;
    this.#emit("degrees");
  }

  /** Switch these parts off and all others on; the plan and its orbits stay. An edit ends it. */
  switchOff(off) {
    Object.assign(this, { off, without: null });
    this.#emit("off");
  }

  /** Show what the plan comes to without parts that were switched off, if they are off still. */
  judgedWithout(off, without) {
    if (off !== this.off) return;
    this.without = without;
    this.#emit("off");
  }

  /** The last states before this one, which undo leads back to. */
  get history() {
    return this.#past.slice(-KEPT_STEPS);
  }

  /** Let undo lead to these states, as before a reload. */
  recall(history) {
    this.#past = history;
    this.#emit("recalled");
  }

  get canUndo() {
    return this.#past.length > 0;
  }

  get canRedo() {
    return this.#future.length > 0;
  }

  undo() {
    this.#step(this.#past, this.#future);
  }

  redo() {
    this.#step(this.#future, this.#past);
  }

  #put({ scenario, anchor }) {
    this.#anchor = anchor;
    this.scenario = scenario;
    this.planId = sameScenario(scenario, anchor.scenario) ? anchor.planId : null;
    this.given = anchor.given && sameOrbits(scenario, anchor.scenario) ? named(anchor.given, namesOf(scenario)) : null;
  }

  #remember(state) {
    this.#past.push(state);
    if (this.#past.length > MOST_STEPS) this.#past.shift();
    this.#future = [];
  }

  #step(from, to) {
    if (!from.length) return;
    to.push(this.state);
    this.#last = { field: null, at: 0 };
    this.#put(from.pop());
    this.#emit("scenario", { live: false, restored: true });
  }

  #emit(name, detail = {}) {
    if (name === "opened" || name === "scenario") {
      this.report = null;
      if (this.off.length) this.switchOff([]);
    }
    // to who comes later, not only the flights of a plan are new
    if (name === "opened") this.#now = { opened: detail };
    else if (name === "plan" || name === "faults") this.#now = { opened: {}, [name]: { ...detail, flown: false } };
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}

/** Given orbits of vehicles that may have been renamed. */
function named({ vehicles, origin }, names) {
  return { vehicles: vehicles.map((one, k) => ({ ...one, name: names[k] })), origin };
}
