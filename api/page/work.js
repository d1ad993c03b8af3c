// The jobs about the plan on show: refinements, validations and flights.

import { byId, element } from "./elements.js";
import { jobsAt, outcomeOf } from "./jobs.js";
import { refinementForm, studyForm } from "./requests.js";
import { STUDIES } from "./tables.js";

/** The panel of jobs; returns what goes on with one by its identifier.
 *
 * `storePlan()` resolves with the identifier of the plan on show. `began(job)`, `changed(job, event)` and
 * `ended(job, result)` follow a job; `result` is null where there is none. `ended` resolves with whether the plan on
 * show is the one that the job was about.
 */
export function offerWork(store, storePlan, { began, changed, ended }) {
  const ofPlans = Object.values(STUDIES).filter(({ of }) => of === "plan");
  const size = () => store.plan.vehicles.length;
  const jobs = jobsAt("job", {
    // what makes a plan is a refinement, which has a form of its own
    forms: (handIn) => ofPlans.map((study) => (study.makes_plan ? refinementForm(study, handIn) : studyForm(study, size, handIn))),
    may: () => store.scenario !== null,
    addressOf: async ({ kind }) => STUDIES[kind].path.slice(1).replace("{plan_id}", await storePlan()),
    wordsOf: (error) => store.deleted(error) || error.message,
    began,
    changed,
    ended: async (job, result) => {
      const current = await ended(job, result);
      return result && [await outcomeOf(job), current ? null : elsewhere(job)];
    },
  });
  byId("work").append(...jobs.elements);
  store.on(["opened", "scenario"], () => jobs.clear());
  store.on(["opened"], () => jobs.suit(store.scenario));
  return (jobId) => jobs.resume(jobId);
}

/** What leads to the plan of a job, where another is on show by now. */
function elsewhere(job) {
  const there = element("a", { href: `?plan=${job.result_plan_id || job.plan_id}`, target: "_blank", rel: "noopener" }, "open it in a new tab");
  return element("p", {}, "This result is of the plan before your edits: ", there, ".");
}
