// Jobs: handed in by forms, followed with the buttons that end them, and shown with what they came to.

import { alert, attemptAt, button, element, notice, present, shown } from "./elements.js";
import { follow } from "./events.js";
import { ask, askJson, patiently, postOnce, Refusal } from "./service.js";
import { ENDED, JOB_KINDS } from "./tables.js";

/** What a refinement gains: the team's predicted error before, and after. */
export function gained({ before, after }) {
  return [before, after].map((one) => shown(one.predicted_rms_m, "m")).join(" → ");
}

/** A place for one job at a time. */
export class Jobs {
  /** the elements to put on the page below the forms */
  elements;
  /** whether the page can hand in a job just now */
  #may;
  /** @type {import("./requests.js").RequestForm[]} */
  #forms;
  /** @type {Record<string, (...given: any[]) => any>} */
  #hooks;
  #fault = alert();
  #jobId = null;
  #ending = "";
  #progress = element("progress", { max: 1, value: 0 });
  #text;
  #cancel = button("Cancel", () => this.#end("cancel", "cancelling …"));
  #finish = button("Finish now", () => this.#end("finish", "ending with the best so far …"), { title: "End with the best found so far" });
  #box;
  #outcome;

  /** `id` is unique on the page. `forms(handIn)` returns the forms, and `addressOf(form)` resolves with where one posts to.
   *
   * `began(job)`, `changed(job, event)` and `ended(job, result)` follow a job; `result` is null where there is none, and
   * the outcome on show is what `ended` resolves with. `wordsOf(error)` says what went wrong.
   * @param {string} id
   * @param {Record<string, (...given: any[]) => any>} how */
  constructor(id, { forms = () => [], may = () => true, ...hooks }) {
    const nothing = () => {};
    this.#hooks = { began: nothing, changed: nothing, wordsOf: (error) => error.message, ...hooks };
    this.#may = may;
    this.#forms = forms((form, request) => this.#handIn(form, request));
    this.#text = element("p", { id: `${id}-text` });
    this.#progress.setAttribute("aria-labelledby", `${id}-text`);
    this.#outcome = element("div", { id: `${id}-outcome`, role: "status" });
    this.#box = element("div", { class: "running", hidden: true }, this.#progress, this.#text, element("div", { class: "row" }, this.#finish, this.#cancel));
    this.elements = [this.#fault, this.#box, this.#outcome];
    this.#enable();
  }

  /** Begin anew with a scenario. */
  clear() {
    this.#outcome.replaceChildren();
    this.#fault.textContent = "";
    for (const form of this.#forms) form.clear();
    this.#enable();
  }

  /** Put into the forms what suits a scenario. */
  suit(scenario) {
    for (const form of this.#forms) form.suit(scenario);
  }

  /** Go on with a job, as after a reload; `check(job)` sees it first. */
  async resume(jobId, check = (_job) => {}) {
    const job = await askJson("GET", `v1/jobs/${encodeURIComponent(jobId)}`);
    check(job);
    await (ENDED.includes(job.state) ? this.#conclude(job) : this.follow(job));
  }

  async #handIn(form, request) {
    this.clear();
    this.#enable(false);
    let job;
    try {
      job = await postOnce(await this.#hooks.addressOf(form), request);
    } catch (error) {
      form.showFault({ faults: error.faults, message: this.#hooks.wordsOf(error) });
      this.#enable();
      if (document.activeElement === document.body) form.button.focus();
      return;
    }
    await this.follow(job, form.button);
  }

  /** Follow a job to its end; the button that was pressed for it, if any, can't keep the focus meanwhile. */
  async follow(job, pressed) {
    this.#enable(false);
    this.#hooks.began(job);
    await attemptAt(this.#fault, async () => this.#conclude(await this.#run(job, Boolean(pressed))));
    const focused = this.#box.contains(document.activeElement) || document.activeElement === document.body;
    this.#jobId = null;
    this.#box.hidden = true;
    this.#enable();
    if (pressed && focused) pressed.focus();
  }

  /** Show a job at work; resolves with the job as it ended. */
  async #run(job, focus) {
    const { title, finishes } = JOB_KINDS[job.kind];
    this.#jobId = job.id;
    this.#ending = "";
    this.#box.hidden = false;
    this.#finish.hidden = !finishes;
    if (focus) this.#cancel.focus();
    this.#show(job);
    notice(`${title} started.`);
    await follow(job.id, {
      changed: (event) => {
        this.#show({ ...job, ...event });
        this.#hooks.changed(job, event);
      },
      away: (flag) => {
        if (flag) this.#text.textContent = `${title}: the service can't be reached; the job goes on once it is back. Trying again …`;
      },
    });
    return patiently(() => askJson("GET", `v1/jobs/${job.id}`));
  }

  async #conclude(job) {
    const { title } = JOB_KINDS[job.kind];
    const done = job.state === "succeeded";
    const result = done ? await patiently(() => askJson("GET", `v1/jobs/${job.id}/result`)) : null;
    this.#outcome.replaceChildren(...present([await this.#hooks.ended(job, result)]));
    if (job.state === "failed") this.#fault.textContent = `${title} failed: ${job.error.detail}`;
    else notice(`${title} ${done ? "done" : "cancelled"}.`);
  }

  #show({ kind, state, progress: { done, total }, doing, best }) {
    Object.assign(this.#progress, { max: total, value: done });
    const { title, unit } = JOB_KINDS[kind];
    const more = this.#ending || doing || (best && `best so far: predicted error ${gained(best)}`);
    this.#text.textContent = `${title} ${state}: ${done} of ${total} ${unit}${more ? `; ${more}` : ""}`;
  }

  async #end(how, words) {
    if (this.#jobId === null) return;
    this.#text.textContent = this.#ending = words;
    try {
      await ask("POST", `v1/jobs/${this.#jobId}/${how}`);
    } catch (error) {
      // 409: it has ended meanwhile, which the events report as well
      if (!(error instanceof Refusal && error.status === 409)) this.#fault.textContent = error.message;
    }
  }

  #enable(free = true) {
    for (const { button: one } of this.#forms) one.disabled = !(free && this.#jobId === null && this.#may());
  }
}
