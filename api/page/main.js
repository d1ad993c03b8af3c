// The page: what there is on it, and how its parts hear of one another.

import { Charts } from "./charts.js";
import { offerDownloads } from "./downloads.js";
import { Editor } from "./editor.js";
import { byId, notice } from "./elements.js";
import { FormationMap } from "./map.js";
import { Planner, theme } from "./planner.js";
import { Player } from "./player.js";
import { askJson, key, postOnce, Refusal } from "./service.js";
import { Store } from "./store.js";
import { showVerdicts } from "./verdict.js";
import { Work } from "./work.js";

const FIRST_EXAMPLE = "paper-grid-same";
const PLAN_FIGURES = ["formation", "timeline", "spectrum", "prediction"];

let waiting = 0;
const store = new Store();
const charts = new Charts(store);
const map = new FormationMap(store);
new Editor(store);
new Player(store, map, charts);
new Planner(store, busy);
showVerdicts(store);
const work = new Work(store, storePlan, { began, cancelled: forgetJob, succeeded });
offerDownloads(store, storePlan);

// --- opening ------------------------------------------------------------------------------------

/** Open a scenario's text, YAML or JSON, or a plan's. */
async function openText(text, name) {
  const { scenario, plan } = readPlan(text);
  const found = await Planner.preview(plan ? JSON.stringify(scenario) : text);
  store.open({ scenario: found.plan.scenario });
  store.judged(found.plan, found.figures, { quick: false });
  address({});
  notice(plan ? `${name}: the plan's scenario, planned again.` : "");
}

async function openExample(name) {
  const answer = await fetch(`assets/examples/${name}.yaml`);
  await openText(await answer.text(), name);
}

async function openPlan(planId) {
  const plan = await askJson("GET", `v1/plans/${planId}`);
  const figures = await Promise.all(
    PLAN_FIGURES.map((name) => askJson("GET", `v1/plans/${planId}/figures/${name}?theme=${theme()}`)),
  );
  store.open({ scenario: plan.scenario, plan, planId, parentId: plan.parent_id });
  store.judged(plan, Object.fromEntries(PLAN_FIGURES.map((name, k) => [name, figures[k]])), { quick: false });
  if (plan.parent_id) {
    const at = `v1/plans/${planId}/figures`;
    await charts.add({ comparison: `${at}/comparison`, refinement: `${at}/refinement` }, { show: "comparison" });
  }
}

function readPlan(text) {
  try {
    const read = JSON.parse(text);
    return read.scenario && read.vehicles ? { scenario: read.scenario, plan: read } : {};
  } catch {
    return {};
  }
}

// --- stored plans and jobs ----------------------------------------------------------------------

/** Resolves with the identifier of the plan on show, which is stored if it was not. */
async function storePlan() {
  if (store.planId) return store.planId;
  const { scenario } = store;
  const plan = await postOnce("v1/plans", scenario);
  if (store.scenario === scenario) {
    store.stored(plan.id, plan.parent_id);
    address({ plan: plan.id });
  }
  return plan.id;
}

function began(job) {
  address({ plan: job.plan_id, job: job.id });
}

function forgetJob() {
  address({ plan: store.planId });
}

async function succeeded(job, result) {
  if (job.kind === "refinement") {
    address({ plan: result.id });
    await openPlan(result.id);
    return;
  }
  address({ plan: job.plan_id });
  const at = `v1/jobs/${job.id}/figures`;
  const found = { accuracy: `${at}/accuracy`, consistency: `${at}/consistency` };
  if (result.series) found.errors = `${at}/errors`;
  await charts.add(found, { show: "accuracy" });
}

/** Say in the address what is on show, so that a link opens it again. */
function address({ plan, job }) {
  const parts = new URLSearchParams();
  if (plan) parts.set("plan", plan);
  if (job) parts.set("job", job);
  const text = parts.toString();
  history.replaceState(null, "", text ? `?${text}` : location.pathname);
}

// --- the bar ------------------------------------------------------------------------------------

byId("examples").addEventListener("change", (event) => {
  const { value } = event.target;
  if (value) attempt(() => openExample(value));
  event.target.value = "";
});
byId("upload").addEventListener("change", async (event) => {
  const [file] = event.target.files;
  event.target.value = "";
  if (file) attempt(async () => openText(await file.text(), file.name));
});
byId("undo").addEventListener("click", () => store.undo());
byId("redo").addEventListener("click", () => store.redo());
byId("share").addEventListener("click", () =>
  attempt(async () => {
    await storePlan();
    await navigator.clipboard.writeText(location.href).catch(() => {});
    notice(`Link to this plan: ${location.href}`);
  }),
);
byId("key-form").addEventListener("submit", (event) => {
  event.preventDefault();
  key.set(byId("key").value.trim());
  attempt(start).then(resume);
});

for (const name of ["opened", "scenario", "plan"]) {
  store.addEventListener(name, () => {
    byId("undo").disabled = !store.canUndo;
    byId("redo").disabled = !store.canRedo;
    byId("map-name").textContent = store.scenario.name || "";
    if (name === "scenario") address({});
  });
}
store.addEventListener("scenario", (event) => {
  if (event.detail.wasRefined) notice("Edited: phases are found anew. Refine again, or undo and open the link to the refined plan.");
});
store.addEventListener("faults", (event) => notice(event.detail.message, { fault: true }));
store.addEventListener("plan", () => byId("notice").classList.contains("bad") && notice(""));

/** Do something that may fail, and say so. */
async function attempt(task) {
  notice("");
  busy(true);
  try {
    await task();
  } catch (error) {
    if (error instanceof Refusal && error.status === 401) askForKey();
    else notice(error.message, { fault: true });
  } finally {
    busy(false);
  }
}

/** Count what there is to wait for. */
function busy(flag) {
  waiting += flag ? 1 : -1;
  byId("workspace").setAttribute("aria-busy", waiting > 0);
}

function askForKey() {
  byId("key-form").hidden = false;
  byId("key-fault").textContent = key.get() ? "This key is not known to the service." : "";
  byId("key").focus();
}

async function start() {
  const asked = new URLSearchParams(location.search);
  if (asked.get("plan")) await openPlan(asked.get("plan"));
  else await openExample(FIRST_EXAMPLE);
  byId("key-form").hidden = true;
  performance.mark("ready");
}

async function resume() {
  const jobId = new URLSearchParams(location.search).get("job");
  if (jobId) await work.resume(jobId).catch((error) => notice(error.message, { fault: true }));
}

attempt(start).then(resume);
