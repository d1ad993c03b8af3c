// Jobs: handed in by forms, followed with the buttons that end them, and shown with what they came to.

import { alert, attemptAt, button, element, notice, present, shown } from "./elements.js";
import { follow as followEvents } from "./events.js";
import { ask, askJson, patiently, postOnce, Refusal } from "./service.js";
import { ENDED, STUDIES } from "./tables.js";
import { explained } from "./terms.js";

/** Resolves with the element that tells the result of a job, as the service does. */
export async function outcomeOf({ id }) {
  const text = await patiently(async () => (await ask("GET", `v1/jobs/${id}/result`, { accept: "text/html" })).text());
  const result = new DOMParser().parseFromString(text, "text/html").body;
  for (const line of result.querySelectorAll("p")) {
    for (const part of [...line.childNodes]) if (part instanceof Text) part.replaceWith(...explained(part.data));
  }
  for (const made of result.querySelectorAll("table")) made.classList.add("losses");
  return element("div", { class: "result", role: "region", tabindex: "0", "aria-label": "Result" }, ...result.childNodes);
}

/** Make a place for one job at a time; `id` is unique on the page.
 *
 * `forms(handIn)` returns the forms, `may()` whether a job can be handed in just now, and `addressOf(form)` resolves with
 * where a form posts to. `began(job)`, `changed(job, event)` and `ended(job, result)` follow a job; `result` is null where
 * there is none, and the outcome on show is what `ended` resolves with. `wordsOf(error)` says what went wrong.
 *
 * Returns the elements to put on the page below the forms, and what begins anew, suits the forms to a scenario, and goes
 * on with a job.
 * @param {string} id
 * @param {Record<string, (...given: any[]) => any>} how */
export function jobsAt(id, { forms: formsOf = () => [], may = () => true, addressOf, began, changed, ended, wordsOf = (error) => error.message }) {
  const fault = alert();
  const progress = element("progress", { max: 1, value: 0, "aria-labelledby": `${id}-text` });
  const text = element("p", { id: `${id}-text` });
  // not read out as it counts
  const elapsed = element("span", { class: "hint" });
  const cancel = button("Cancel", () => end("cancel", "cancelling …"));
  const finish = button("Finish now", () => end("finish", "ending with the best so far …"), { title: "End with the best found so far" });
  const box = element("div", { class: "running", hidden: true }, progress, text, element("div", { class: "row" }, finish, cancel, elapsed));
  const outcome = element("div", { id: `${id}-outcome`, role: "status" });
  /** @type {string | null} */
  let jobId = null;
  let ending = "";
  /** @type {import("./requests.js").RequestForm[]} */
  const forms = formsOf(handIn);
  enable();
  return { elements: [fault, box, outcome], clear, suit, resume, follow };

  /** Begin anew with a scenario. */
  function clear() {
    outcome.replaceChildren();
    fault.textContent = "";
    for (const form of forms) form.clear();
    enable();
  }

  /** Put into the forms what suits a scenario. */
  function suit(scenario) {
    for (const form of forms) form.suit(scenario);
  }

  /** Go on with a job, as after a reload; `check(job)` sees it first. */
  async function resume(asked, check = (_job) => {}) {
    const job = await askJson("GET", `v1/jobs/${encodeURIComponent(asked)}`);
    check(job);
    forms.find(({ kind }) => kind === job.kind)?.fill(job.request);
    await (ENDED.includes(job.state) ? conclude(job) : follow(job));
  }

  async function handIn(form, request) {
    clear();
    enable(false);
    let job;
    try {
      job = await postOnce(await addressOf(form), request);
    } catch (error) {
      form.showFault({ faults: error.faults, message: wordsOf(error) });
      enable();
      if (document.activeElement === document.body) form.button.focus();
      return;
    }
    await follow(job, form.button);
  }

  /** Follow a job to its end; the button that was pressed for it, if any, can't keep the focus meanwhile.
   * @param {any} job
   * @param {HTMLElement} [pressed] */
  async function follow(job, pressed) {
    enable(false);
    began?.(job);
    await attemptAt(fault, async () => conclude(await run(job, Boolean(pressed))));
    const focused = box.contains(document.activeElement) || document.activeElement === document.body;
    jobId = null;
    box.hidden = true;
    enable();
    if (focused) pressed?.focus();
  }

  /** Show a job at work; resolves with the job as it ended. */
  async function run(job, focus) {
    const { title, ends_early: finishes } = STUDIES[job.kind];
    jobId = job.id;
    ending = "";
    box.hidden = false;
    finish.hidden = !finishes;
    if (focus) cancel.focus();
    show(job);
    notice(`${title} started.`);
    const begun = Date.parse(job.created_at);
    const count = () => (elapsed.textContent = `${Math.max(0, Math.round((Date.now() - begun) / 1000))} s since it was handed in`);
    count();
    const counting = setInterval(count, 1000);
    try {
      await followEvents(job.id, {
        changed: (event) => {
          show({ ...job, ...event });
          changed?.(job, event);
        },
        away: (flag) => {
          if (flag) text.textContent = `${title}: the service can't be reached; the job goes on once it is back. Trying again …`;
        },
      });
    } finally {
      clearInterval(counting);
    }
    return patiently(() => askJson("GET", `v1/jobs/${job.id}`));
  }

  async function conclude(job) {
    const { title } = STUDIES[job.kind];
    const done = job.state === "succeeded";
    const result = done ? await patiently(() => askJson("GET", `v1/jobs/${job.id}/result`)) : null;
    outcome.replaceChildren(...present([await ended(job, result)]));
    outcome.scrollIntoView({ block: "nearest" });
    if (job.state === "failed") fault.textContent = `${title} failed: ${job.error.detail}`;
    else notice(`${title} ${done ? "done" : "cancelled"}.`);
  }

  function show({ kind, state, progress: { done, total }, doing, best }) {
    Object.assign(progress, { max: total, value: done });
    const { title, unit } = STUDIES[kind];
    const gained = best && [best.before, best.after].map((judged) => shown(judged.predicted_rms_m, "m")).join(" → ");
    const more = ending || doing || (best && `best so far: predicted error ${gained}`);
    text.textContent = `${title} ${state}: ${done} of ${total} ${unit}${more ? `; ${more}` : ""}`;
  }

  async function end(how, words) {
    if (jobId === null) return;
    text.textContent = ending = words;
    try {
      await ask("POST", `v1/jobs/${jobId}/${how}`);
    } catch (error) {
      // 409: it has ended meanwhile, which the events report as well
      if (!(error instanceof Refusal && error.status === 409)) fault.textContent = error.message;
    }
  }

  function enable(free = true) {
    for (const form of forms) form.button.disabled = !(free && jobId === null && may());
  }
}
