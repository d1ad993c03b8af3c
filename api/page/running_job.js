// A job at work: its progress, the buttons that end it, and its end.

import { element, notice, shown } from "./elements.js";
import { follow } from "./events.js";
import { ask, askJson, patiently, Refusal } from "./service.js";
import { JOB_KINDS } from "./tables.js";

/** What a refinement gains: the team's predicted error before, and after. */
export function gained({ before, after }) {
  return [before, after].map((one) => shown(one.predicted_rms_m, "m")).join(" → ");
}

/** The box that shows a job at work. `id` is unique on the page; `fault` is the element for errors. */
export class RunningJob {
  #fault;
  #jobId = null;
  #ending = "";
  #progress;
  #text;
  #cancel = element("button", { type: "button", onclick: () => this.#end("cancel", "cancelling …") }, "Cancel");
  #finish = element(
    "button",
    { type: "button", title: "End with the best found so far", onclick: () => this.#end("finish", "ending with the best so far …") },
    "Finish now",
  );

  constructor(id, fault) {
    this.#fault = fault;
    this.#progress = element("progress", { max: 1, value: 0, "aria-labelledby": `${id}-text` });
    this.#text = element("p", { id: `${id}-text` });
    const buttons = element("div", { class: "row" }, this.#finish, this.#cancel);
    this.element = element("div", { class: "running", hidden: true }, this.#progress, this.#text, buttons);
  }

  /** Whether a job is at work here. */
  get busy() {
    return this.#jobId !== null;
  }

  /** Follow a job; resolves with the job as it ended. `changed(event)` is called at each change. */
  async follow(job, { focus = false, changed = (_event) => {} } = {}) {
    const { title, finishes } = JOB_KINDS[job.kind];
    this.#jobId = job.id;
    this.#ending = "";
    this.element.hidden = false;
    this.#finish.hidden = !finishes;
    if (focus) this.#cancel.focus();
    this.#show(job);
    notice(`${title} started.`);
    await follow(job.id, {
      changed: (event) => {
        this.#show({ ...job, ...event });
        changed(event);
      },
      away: (flag) => flag && this.#sayAway(title),
    });
    return patiently(() => askJson("GET", `v1/jobs/${job.id}`));
  }

  /** Hide the box; returns whether the focus was in it, or nowhere. */
  close() {
    const focused = this.element.contains(document.activeElement) || document.activeElement === document.body;
    this.#jobId = null;
    this.element.hidden = true;
    return focused;
  }

  #show({ kind, state, progress: { done, total }, doing, best }) {
    this.#progress.max = total;
    this.#progress.value = done;
    const { title, unit } = JOB_KINDS[kind];
    const more = this.#ending || doing || (best && `best so far: predicted error ${gained(best)}`);
    this.#text.textContent = `${title} ${state}: ${done} of ${total} ${unit}${more ? `; ${more}` : ""}`;
  }

  #sayAway(title) {
    this.#text.textContent = `${title}: the service can't be reached; the job goes on once it is back. Trying again …`;
  }

  async #end(how, words) {
    if (!this.busy) return;
    this.#ending = words;
    this.#text.textContent = words;
    try {
      await ask("POST", `v1/jobs/${this.#jobId}/${how}`);
    } catch (error) {
      // 409: it has ended meanwhile, which the events report as well
      if (!(error instanceof Refusal && error.status === 409)) this.#fault.textContent = error.message;
    }
  }
}
