// What the page knows: the scenario being edited, its plan, and who wants to hear of changes.

import { editable } from "./scenario.js";

const MOST_STEPS = 100;
const SAME_EDIT_MS = 1000;

/** The page's state. Events: "opened", "scenario" (edited), "plan" (judged), "faults", "selected". */
export class Store extends EventTarget {
  scenario = null;
  plan = null;
  /** identifier of the plan as stored; null while it is an edit that nobody has stored */
  planId = null;
  /** identifier of the plan it was refined from */
  parentId = null;
  selected = null;
  #past = [];
  #future = [];
  #last = { field: null, at: 0 };

  /** Take an edit: the plan on show is then of an older scenario until the service answers.
   *
   * Edits of one field that follow each other at once are one step to undo.
   */
  edit(scenario, { live = false, step = true, field = null } = {}) {
    const at = performance.now();
    const goesOn = field !== null && field === this.#last.field && at - this.#last.at < SAME_EDIT_MS;
    this.#last = { field, at };
    if (step && !goesOn && this.scenario) this.#remember(this.scenario);
    const wasRefined = this.parentId !== null;
    Object.assign(this, { scenario, planId: null, parentId: null });
    this.#tell("scenario", { live, wasRefined });
  }

  /** Start over with a plan, stored or not. */
  open({ plan, planId = null, parentId = null }) {
    if (this.scenario) this.#remember(this.scenario);
    const scenario = editable(plan);
    Object.assign(this, { scenario, plan, planId, parentId, selected: null });
    this.#tell("opened");
  }

  judged(plan, figures, { quick }) {
    this.plan = plan;
    this.#tell("plan", { figures, quick });
  }

  faulty(faults, message) {
    this.#tell("faults", { faults, message });
  }

  stored(planId, parentId) {
    Object.assign(this, { planId, parentId });
  }

  /** What went wrong in words, if it is that the plan on show was deleted; it is stored anew then. */
  deleted(error) {
    if (error.status !== 404 || !this.planId) return null;
    this.stored(null, null);
    return "This plan was deleted from the service. Try again: its scenario is planned and stored anew.";
  }

  select(what) {
    this.selected = what;
    this.#tell("selected");
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

  #remember(scenario) {
    this.#past.push(scenario);
    if (this.#past.length > MOST_STEPS) this.#past.shift();
    this.#future = [];
  }

  #step(from, to) {
    if (!from.length) return;
    to.push(this.scenario);
    const scenario = from.pop();
    this.edit(scenario, { step: false });
  }

  #tell(name, detail = {}) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}
