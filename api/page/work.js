// Refinements, validations and flights as jobs: submitted, followed, cancelled, and their results.

import { byId, element, notice, shown } from "./elements.js";
import { flown } from "./flight_outcome.js";
import { flightForm } from "./flight_request.js";
import { refinementForm, validationForm } from "./requests.js";
import { gained, RunningJob } from "./running_job.js";
import { askJson, patiently, postOnce } from "./service.js";
import { ENDED, JOB_KINDS } from "./tables.js";
import { explained } from "./terms.js";

/** share of the least separation that may be lost without a word */
const KEPT_SHARE = 0.9;
/** What a result says, by the kind of its job: `(result, lost) => elements`. */
const OUTCOMES = { refinement: refined, validation: validated, flight: flown };

/** The panel of jobs.
 *
 * `storePlan()` resolves with the identifier of the plan on show. `follower.began(job)`, `follower.changed(job, event)`
 * and `follower.ended(job, result)` follow a job; `result` is null where there is none. `ended` resolves
 * with whether the plan on show is the one that the job was about.
 */
export class Work {
  #store;
  #storePlan;
  #follower;
  #fault = element("p", { class: "fault", role: "alert", id: "work-fault" });
  #running = new RunningJob("job", this.#fault);
  #outcome = element("div", { class: "outcome", role: "status" });
  #forms;

  constructor(store, storePlan, follower) {
    this.#store = store;
    this.#storePlan = storePlan;
    this.#follower = follower;
    const handIn = (form, request) => this.#handIn(form, request);
    const size = () => store.plan.vehicles.length;
    this.#forms = [refinementForm(handIn), validationForm(size, handIn), flightForm(size, handIn)];
    byId("work").append(...this.#forms.map((form) => form.element), this.#fault, this.#running.element, this.#outcome);
    store.on(["opened", "scenario"], () => this.#clear());
    store.on(["opened"], () => {
      for (const form of this.#forms) form.suit(store.scenario);
    });
    this.#enable();
  }

  /** Go on following a job, as after a reload. */
  async resume(jobId) {
    const job = await askJson("GET", `v1/jobs/${encodeURIComponent(jobId)}`);
    await (ENDED.includes(job.state) ? this.#conclude(job) : this.#follow(job));
  }

  async #handIn(form, request) {
    this.#clear();
    this.#enable(false);
    let job;
    try {
      job = await postOnce(`v1/plans/${await this.#storePlan()}/${JOB_KINDS[form.kind].collection}`, request);
    } catch (error) {
      const deleted = this.#store.deleted(error);
      form.showFault(deleted ? { message: deleted } : error);
      this.#enable();
      if (document.activeElement === document.body) form.button.focus();
      return;
    }
    await this.#follow(job, form.button);
  }

  async #follow(job, button) {
    this.#enable(false);
    this.#follower.began(job);
    try {
      // the button that was pressed can't keep the focus
      await this.#conclude(await this.#running.follow(job, { focus: Boolean(button), changed: (event) => this.#follower.changed(job, event) }));
    } catch (error) {
      this.#fault.textContent = error.message;
    } finally {
      const focused = this.#running.close();
      this.#enable();
      if (button && focused) button.focus();
    }
  }

  async #conclude(job) {
    const name = JOB_KINDS[job.kind].title;
    if (job.state === "succeeded") {
      const result = await patiently(() => askJson("GET", `v1/jobs/${job.id}/result`));
      const lost = await this.#lostOf(job);
      const current = await this.#follower.ended(job, result);
      this.#outcome.replaceChildren(...OUTCOMES[job.kind](result, lost), ...(current ? [] : [elsewhere(job)]));
      notice(`${name} done.`);
      return;
    }
    await this.#follower.ended(job, null);
    if (job.state === "failed") this.#fault.textContent = `${name} failed: ${job.error.detail}`;
    else notice(`${name} cancelled.`);
  }

  /** The motions that no sighting can detect, of the plan that a report is about. */
  async #lostOf(job) {
    if (!JOB_KINDS[job.kind].reports) return [];
    const current = this.#store.planId === job.plan_id;
    const plan = current ? this.#store.plan : await patiently(() => askJson("GET", `v1/plans/${job.plan_id}`));
    return plan.observability.unobservable;
  }

  #clear() {
    this.#outcome.replaceChildren();
    this.#fault.textContent = "";
    for (const form of this.#forms) form.clear();
    this.#enable();
  }

  #enable(free = true) {
    const may = free && !this.#running.busy && this.#store.scenario !== null;
    for (const form of this.#forms) form.button.disabled = !may;
  }
}

/** What leads to the plan of a job, where another is on show by now. */
function elsewhere(job) {
  const plan = job.result_plan_id || job.plan_id;
  return element(
    "p",
    {},
    "This result is of the plan before your edits: ",
    element("a", { href: `?plan=${plan}`, target: "_blank", rel: "noopener" }, "open it in a new tab"),
    ".",
  );
}

function refined(plan) {
  const { improved, reason, before, after } = plan.refinement;
  // what is not to be flown is no success, however small its error
  const go = plan.verdict?.go === true;
  return [
    element(
      "p",
      { class: `badge ${improved && go ? "good" : ""}` },
      improved ? `Predicted error ${gained({ before, after })}` : "No better plan was found",
    ),
    element("p", {}, ...explained(improved ? `Rank ${before.rank} → ${after.rank}.` : reason)),
    improved && after.least_distance_m !== null ? separationOf(before.least_distance_m, after.least_distance_m) : null,
  ].filter(Boolean);
}

/** How near vehicles come before and after: what is gained in error may be paid for in room. */
function separationOf(before, after) {
  const text = `Least separation ${shown(before)} → ${shown(after, "m")}.`;
  if (after >= KEPT_SHARE * before) return element("p", {}, ...explained(text));
  return element(
    "p",
    { class: "remark" },
    element("strong", {}, `⚠ ${text} `),
    "Vehicles come closer to each other than before. “Least separation” in the scenario limits this.",
  );
}

function validated(report, lost) {
  const { overall, anees, trials } = report;
  // what a filter believes of a motion that nothing detects is no proof; what is not to be flown is no success
  const doubtful = lost.length > 0 || report.verdict?.go === false;
  const looks = { consistent: doubtful ? "" : "good", unknown: "" };
  const look = looks[anees.verdict] ?? "bad";
  return [
    element(
      "p",
      { class: `badge ${look}` },
      `Found ${shown(overall.rms_second_half_m, "m")}, predicted ${shown(overall.predicted_rms_m, "m")}`,
    ),
    element("p", {}, ...explained(`RMS over the second half of ${counted(trials)}. ${consistencyOf(anees)}`)),
    ...spreadOf(overall),
    ...furtherErrors(report.errors ?? []),
    ...(lost.length ? [unproven(lost)] : []),
  ];
}

function consistencyOf(anees) {
  if (anees.verdict === "unknown") return "Too few trials to show whether the filter is consistent: run more.";
  const [low, high] = anees.band.map((end) => shown(end));
  return `The filter is ${anees.verdict}: ANEES ${shown(anees.value)}, 95 % interval ${low} to ${high}.`;
}

/** What to expect of one trial, and how often to expect worse; reports of earlier versions do not say. */
function spreadOf(overall) {
  const { median_rms_second_half_m: median, share_over_3_predicted: far, share_over_10_predicted: lost } = overall;
  if (median === undefined || median === null) return [];
  const often = far ? ` In ${percent(far)} of the trials some vehicle is off by more than 3 times the prediction, in ${percent(lost)} by more than 10 times.` : "";
  return [element("p", {}, `Median trial ${shown(median, "m")}.${often}`)];
}

/** What was found of the filter's other states, beside the prediction. */
function furtherErrors(errors) {
  if (!errors.length) return [];
  const row = ({ state, unit, rms_second_half: found, predicted_rms: predicted }) =>
    element("tr", {}, ...[state, shown(found, unit), shown(predicted, unit)].map((text) => element("td", {}, text)));
  const heads = ["Error", "Found", "Predicted"].map((text) => element("th", { scope: "col" }, text));
  return [
    element(
      "details",
      {},
      element("summary", {}, "Errors that the filter estimates"),
      element("table", { class: "losses" }, element("thead", {}, element("tr", {}, ...heads)), element("tbody", {}, ...errors.map(row))),
    ),
  ];
}

function percent(share) {
  return `${shown(100 * share)} %`;
}

function unproven(lost) {
  return element(
    "p",
    { class: "remark" },
    element("strong", {}, "The plan is not observable. "),
    `A consistent filter does not determine what no sighting can detect: ${lost.map((one) => one.description).join("; ")}.`,
  );
}

function counted(trials) {
  return trials === 1 ? "1 trial" : `${trials} trials`;
}
