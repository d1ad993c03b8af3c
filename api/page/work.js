// Refinement and validation as jobs: handed in, followed, cancelled, and what came of them.

import { byId, element, notice, shown } from "./elements.js";
import { follow } from "./events.js";
import { ask, askJson, postOnce, Refusal } from "./service.js";

const OBJECTIVES = {
  "": "predicted error of the team",
  worst_predicted_rms: "predicted error of the worst vehicle",
  logdet: "information (log-determinant)",
  min_eigenvalue: "least-known motion (smallest eigenvalue)",
  trace: "information (trace)",
};
const SERIES_LIMIT = 24;

/** The panel of jobs. `storePlan()` resolves with the identifier of the plan on show. */
export class Work {
  #store;
  #storePlan;
  #done;
  #following = null;
  #place = byId("work");
  #progress = element("progress", { max: 1, value: 0, "aria-labelledby": "job-text" });
  #text = element("p", { id: "job-text", role: "status" });
  #fault = element("p", { class: "fault", role: "alert", id: "work-fault" });
  #cancel = element("button", { type: "button", onclick: () => this.#cancelJob() }, "Cancel");
  #running = element("div", { class: "running", hidden: true });
  #outcome = element("div", { class: "outcome", "aria-live": "polite" });
  #buttons = [];

  constructor(store, storePlan, done) {
    this.#store = store;
    this.#storePlan = storePlan;
    this.#done = done;
    this.#running.append(this.#progress, this.#text, this.#cancel);
    this.#place.append(this.#refineForm(), this.#validateForm(), this.#fault, this.#running, this.#outcome);
    store.addEventListener("opened", () => this.#enable());
    store.addEventListener("scenario", () => this.#outcome.replaceChildren());
    this.#enable();
  }

  /** Go on following a job, as after a reload. */
  async resume(jobId) {
    const job = await askJson("GET", `v1/jobs/${jobId}`);
    await this.#follow(job);
  }

  #refineForm() {
    const objective = choice("refine-objective", OBJECTIVES);
    const centers = check("refine-centers", "centres, by up to", true);
    const box = number("refine-box", 5, { min: 0 });
    const radii = check("refine-radii", "radii, from", false);
    const least = number("refine-least", 15, { min: 0, label: "Least radius in m" });
    const most = number("refine-most", 25, { min: 0, label: "Largest radius in m" });
    const time = number("refine-time", 30, { min: 1 });
    const read = () => {
      const vary = ["phases"];
      const request = { time_limit_s: time.valueAsNumber };
      if (centers.input.checked) {
        vary.push("centers");
        request.center_box_m = box.valueAsNumber;
      }
      if (radii.input.checked) {
        vary.push("radii");
        request.radius_m = [least.valueAsNumber, most.valueAsNumber];
      }
      return { ...request, vary, ...(objective.value ? { objective: objective.value } : {}) };
    };
    box.setAttribute("aria-label", "How far a centre may move each way, in m");
    return this.#form(
      "Refine",
      "Move phases, centres and radii to the least predicted error.",
      "refinements",
      read,
      wide("Improve the", objective),
      element("div", { class: "row" }, "Move phases,", centers.label, box, "m"),
      element("div", { class: "row" }, radii.label, least, "to", most, "m"),
      labelled("Time limit (s)", time),
    );
  }

  #validateForm() {
    const trials = number("validate-trials", 200, { min: 1 });
    const seed = number("validate-seed", 1, { min: 0 });
    const read = () => ({
      trials: trials.valueAsNumber,
      seed: seed.valueAsNumber,
      series: this.#store.plan.vehicles.length <= SERIES_LIMIT,
    });
    return this.#form(
      "Validate",
      "Fly the plan many times with the filter and compare the errors with the prediction.",
      "validations",
      read,
      labelled("Trials", trials),
      labelled("Seed", seed),
    );
  }

  #form(title, hint, collection, read, ...fields) {
    const button = element("button", { type: "submit", class: "primary" }, title);
    this.#buttons.push(button);
    const form = element(
      "form",
      { class: "task", novalidate: true, "aria-label": title },
      element("p", { class: "hint" }, hint),
      ...fields,
      button,
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#handIn(collection, read());
    });
    return form;
  }

  async #handIn(collection, request) {
    this.#fault.textContent = "";
    this.#outcome.replaceChildren();
    this.#enable(false);
    try {
      const planId = await this.#storePlan();
      const job = await postOnce(`v1/plans/${planId}/${collection}`, request);
      await this.#follow(job);
    } catch (error) {
      this.#tell(error);
    } finally {
      this.#enable();
    }
  }

  async #follow(job) {
    const stop = new AbortController();
    this.#following = { id: job.id, stop };
    this.#running.hidden = false;
    this.#enable(false);
    this.#done.began(job);
    this.#show(job);
    const name = job.kind === "refinement" ? "Refinement" : "Validation";
    try {
      await follow(job.id, {
        signal: stop.signal,
        told: (event) => this.#show({ ...job, ...event }),
        away: (flag) => flag && (this.#text.textContent = `${name}: the service can't be reached; the job goes on once it is back. Trying again …`),
      });
      await this.#conclude(await askJson("GET", `v1/jobs/${job.id}`), name);
    } catch (error) {
      this.#tell(error);
    } finally {
      this.#following = null;
      this.#running.hidden = true;
      this.#enable();
    }
  }

  #show(job) {
    const { done, total } = job.progress;
    this.#progress.max = total;
    this.#progress.value = done;
    const what = job.kind === "refinement" ? "starts" : "trials";
    const name = job.kind === "refinement" ? "Refinement" : "Validation";
    this.#text.textContent = `${name} ${job.state}: ${done} of ${total} ${what}`;
  }

  async #conclude(job, name) {
    if (job.state === "failed") {
      this.#fault.textContent = `${name} failed: ${job.error.detail}`;
      return;
    }
    if (job.state === "cancelled") {
      notice(`${name} cancelled.`);
      this.#done.cancelled(job);
      return;
    }
    const result = await askJson("GET", `v1/jobs/${job.id}/result`);
    this.#outcome.replaceChildren(...(job.kind === "refinement" ? refined(result) : validated(result)));
    await this.#done.succeeded(job, result);
    // opening the refined plan clears what was shown of the one before
    if (!this.#outcome.childElementCount && job.kind === "refinement") this.#outcome.replaceChildren(...refined(result));
    notice(`${name} done.`);
  }

  async #cancelJob() {
    if (!this.#following) return;
    this.#text.textContent = "Cancelling …";
    try {
      await ask("POST", `v1/jobs/${this.#following.id}/cancel`);
    } catch (error) {
      // 409: it has ended meanwhile, which the events tell as well
      if (!(error instanceof Refusal && error.status === 409)) this.#tell(error);
    }
  }

  #tell(error) {
    const told = (error.faults || []).map((one) => `${one.path}: ${one.message}`);
    this.#fault.textContent = told.length ? told.join("; ") : error.message;
  }

  #enable(free = true) {
    const may = free && !this.#following && this.#store.scenario !== null;
    for (const button of this.#buttons) button.disabled = !may;
  }
}

function refined(plan) {
  const { improved, reason, before, after } = plan.refinement;
  const rms = (one) => shown(one.predicted_rms_m, "m");
  return [
    element(
      "p",
      { class: `badge ${improved ? "good" : ""}` },
      improved ? `Predicted error ${rms(before)} → ${rms(after)}` : "Nothing better was found",
    ),
    element("p", {}, improved ? `Rank ${before.rank} → ${after.rank}; least distance ${shown(after.least_distance_m, "m")}.` : reason),
  ];
}

function validated(report) {
  const { overall, anees, trials } = report;
  return [
    element(
      "p",
      { class: `badge ${anees.verdict === "consistent" ? "good" : "bad"}` },
      `Found ${shown(overall.rms_second_half_m, "m")}, predicted ${shown(overall.predicted_rms_m, "m")}`,
    ),
    element("p", {}, `RMS over the second half of ${trials} trials. The filter is ${anees.verdict}: ANEES ${shown(anees.value)}.`),
  ];
}

function choice(id, choices) {
  const options = Object.entries(choices).map(([value, text]) => element("option", { value }, text));
  return element("select", { id }, ...options);
}

function number(id, value, { min, label } = {}) {
  return element("input", { id, type: "number", step: "any", value, min, "aria-label": label });
}

function check(id, text, checked) {
  const input = element("input", { id, type: "checkbox", checked });
  return { input, label: element("label", { for: id, class: "check" }, input, ` ${text}`) };
}

function wide(text, input) {
  return element("div", { class: "field wide" }, element("label", { for: input.id }, text), input);
}

function labelled(text, input) {
  return element("div", { class: "field" }, element("label", { for: input.id }, text), input);
}
