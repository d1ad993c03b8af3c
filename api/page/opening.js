// Opening: examples, files, stored plans, and what a reload interrupted.

import { Address } from "./address.js";
import { notice } from "./elements.js";
import { Planner } from "./planner.js";
import { editable } from "./scenario.js";
import { ask, askJson, noSuchPlan, passing, patiently } from "./service.js";
import { discard, forget, kept } from "./session.js";
import { Store } from "./store.js";

export const FIRST_EXAMPLE = "paper-grid-same";
/** names of archives, of which the only ones read are those of recordings */
const ARCHIVE = /\.(zip|tar|t?gz)$/i;

/** What a visit begins with, asked for while the code of the map still comes: its answer by plan or example. */
const early = new Map();
{
  const { plan } = Address.asked;
  if (plan) early.set(plan, Planner.stored(plan));
  else if (!kept()) early.set(FIRST_EXAMPLE, exampled(FIRST_EXAMPLE));
  // who opens it hears of a fault
  for (const answer of early.values()) answer.catch(() => {});
}

/** The answer that was asked for early, once, and otherwise what `ask()` brings. */
function begun(name, ask) {
  const answer = early.get(name)?.catch(wanted) ?? ask();
  early.clear();
  return answer;
}

/** Ask for the key that the service wanted when nobody listened yet. */
function wanted(error) {
  if (error.status === 401) document.dispatchEvent(new Event("syncplan:key"));
  throw error;
}

/** Puts into a store what is chosen; an answer that comes after another choice is dropped. */
export class Opening {
  #store;
  #address;
  #fit;
  #choices = 0;
  /** shows the recordings that the service keeps, once the panels are there */
  showRecordings = () => {};

  /** `fit()` brings all of the scenario into view. */
  constructor(store, address, fit) {
    this.#store = store;
    this.#address = address;
    this.#fit = fit;
  }

  async example(name) {
    const choice = ++this.#choices;
    this.#take(await begun(name, () => exampled(name)), name, choice);
  }

  /** Open a new scenario; `change` completes it, once the service has made its centres. */
  async team(scenario, change) {
    const choice = ++this.#choices;
    const { plan } = await Planner.preview(scenario, { figures: [], quick: true });
    if (choice === this.#choices) await this.#text(JSON.stringify(change(editable(plan))), scenario.name, choice, true);
  }

  /** Open a scenario or a plan, or send a recording; what is none of them is a file of the field, whose places are offered. */
  async file(file) {
    const choice = ++this.#choices;
    const { name } = file;
    if (ARCHIVE.test(name)) {
      const { sendRecording } = await import("./kept_work.js");
      await sendRecording(file);
      this.showRecordings();
      return;
    }
    const text = await file.text();
    if (/\.ya?ml$/i.test(name) || isScenario(text)) {
      await this.#text(text, name, choice);
      return;
    }
    const imported = await askJson("POST", `v1/imports?${new URLSearchParams({ file: name })}`, { body: file, type: "application/octet-stream" });
    const { showImport } = await import("./importing.js");
    if (choice !== this.#choices) return;
    const open = (scenario) => this.#text(JSON.stringify(scenario), name, ++this.#choices, true);
    showImport(this.#store, imported, { name, open, fit: this.#fit });
  }

  /** Open a plan that a report holds, or a formation. */
  async formation(plan, name) {
    const scenario = { name, ...plan.scenario };
    await this.#text(JSON.stringify({ ...plan, scenario }), name, ++this.#choices, true);
  }

  /** Open a stored plan; `opened()` is called once it is there, before it is drawn. */
  async plan(planId, { opened = () => {} } = {}) {
    const choice = ++this.#choices;
    const { plan, figures } = /** @type {any} */ (await begun(planId, () => Planner.stored(planId)).catch(noSuchPlan));
    if (choice !== this.#choices) return;
    this.#store.open({ plan, planId });
    opened();
    this.#store.judged(plan, figures, { quick: false, opened: true });
  }

  /** Open what was being edited before a reload, or unsaved work of a closed tab; resolves with whether there was such. */
  async edit(work = kept()) {
    if (!work) return false;
    const choice = ++this.#choices;
    const before = new Store();
    try {
      before.reopen(work.state, null);
      const { plan, figures } = await Planner.preview(before.document);
      if (choice !== this.#choices) return true;
      this.#store.reopen(work.state, plan);
      this.#store.judged(plan, figures, { quick: false });
      if (work.scenario) this.#store.edit(work.scenario);
      // it is this tab's now
      discard(work);
      return true;
    } catch (error) {
      if (passing(error) || error.status === 401) throw error;
      // what an older page kept may mean nothing to this one
      forget();
      discard(work);
      return false;
    }
  }

  /** Open a scenario's text, YAML or JSON, or a plan's; `fresh` says that no file has it. */
  async #text(text, name, choice, fresh = false) {
    this.#take(await Planner.preview(planIn(text) || text), name, choice, fresh);
  }

  #take({ plan, figures }, name, choice, fresh = false) {
    if (choice !== this.#choices) return;
    this.#store.open({ plan, origin: "file", fresh });
    this.#store.judged(plan, figures, { quick: false });
    this.#address.write();
    if (this.#store.given) notice(`${name}: the plan with its own phases, judged afresh.`);
  }
}

/** The plan of an example; the first one comes within the page. */
async function exampled(name) {
  const within = document.getElementById(name)?.textContent;
  const text = within ?? (await (await ask("GET", `assets/examples/${name}.yaml`, { accept: "application/yaml" })).text());
  return patiently(() => Planner.preview(text));
}

/** What the service reads of the plan that a JSON file holds, null for anything else. */
function planIn(text) {
  const { scenario, vehicles } = jsonOf(text) ?? {};
  return scenario && vehicles ? { scenario, vehicles } : null;
}

/** Whether a text is a scenario or a plan, if perhaps with faults, by keys at its top. */
function isScenario(text) {
  const value = jsonOf(text);
  if (value !== null && typeof value === "object") return ["orbit", "formation", "sensor", "scenario"].some((key) => key in value);
  return /^[\s{]*["']?(orbit|formation|sensor|scenario)["']?\s*:/m.test(text);
}

/** What JSON text holds; null for anything else. */
function jsonOf(text) {
  try {
    return JSON.parse(text);
  } catch {
    return null;
  }
}
