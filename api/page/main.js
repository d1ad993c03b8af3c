// The page: what there is on it, and how its parts hear of one another.

import { Charts } from "./charts.js";
import { offerDownloads } from "./downloads.js";
import { Editor } from "./editor.js";
import { byId, notice } from "./elements.js";
import { askForKeys } from "./keys.js";
import { FormationMap } from "./map.js";
import { PLAN_FIGURES, Planner, theme } from "./planner.js";
import { Player } from "./player.js";
import { ask, askJson, noSuchPlan, postOnce } from "./service.js";
import { listenForKeys } from "./shortcuts.js";
import { Store } from "./store.js";
import { showVerdicts } from "./verdict.js";
import { Work } from "./work.js";

const FIRST_EXAMPLE = "paper-grid-same";

let waiting = 0;
const store = new Store();
const charts = new Charts(store);
const map = new FormationMap(store);
new Editor(store);
new Player(store, map, charts);
new Planner(store, busy);
showVerdicts(store);
listenForKeys(store);
const work = new Work(store, storePlan, { began, ended });
offerDownloads(store, storePlan);

// --- opening ------------------------------------------------------------------------------------

/** counts what was chosen to open: an answer that comes after another choice is dropped */
let opening = 0;

/** Open a scenario's text, YAML or JSON, or a plan's, unless something was chosen after that turn. */
async function openText(text, name, turn) {
  const plan = planIn(text);
  const found = await Planner.preview(plan ? plan.scenario : text);
  if (turn !== opening) return;
  store.open({ plan: found.plan });
  store.judged(found.plan, found.figures, { quick: false });
  address({});
  if (plan) notice(`${name}: the plan's scenario, planned again.`);
}

async function openExample(name) {
  const turn = ++opening;
  const answer = await ask("GET", `assets/examples/${name}.yaml`, { accept: "application/yaml" });
  await openText(await answer.text(), name, turn);
}

async function openFile(file) {
  const turn = ++opening;
  await openText(await file.text(), file.name, turn);
}

async function openPlan(planId) {
  const turn = ++opening;
  const at = `v1/plans/${encodeURIComponent(planId)}`;
  const [plan, figures] = await Promise.all([askJson("GET", at), figuresOf(at)]).catch(noSuchPlan);
  if (turn !== opening) return;
  store.open({ plan, planId, parentId: plan.parent_id });
  store.judged(plan, figures, { quick: false });
  if (!plan.parent_id) return;
  const more = { comparison: `${at}/figures/comparison`, refinement: `${at}/figures/refinement` };
  await charts.add(more, { show: "comparison" });
}

async function figuresOf(at) {
  const asked = PLAN_FIGURES.map((name) => askJson("GET", `${at}/figures/${name}?theme=${theme()}`));
  const found = await Promise.all(asked);
  return Object.fromEntries(PLAN_FIGURES.map((name, k) => [name, found[k]]));
}

/** The plan that a file holds, null for a scenario. */
function planIn(text) {
  try {
    const read = JSON.parse(text);
    return read.scenario && read.vehicles ? read : null;
  } catch {
    return null;
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

let following = null;

function began(job) {
  following = job.id;
  address({ plan: store.planId });
}

/** Show what a job came to; resolves with whether the plan on show is still the one it was about. */
async function ended(job, result) {
  following = null;
  const current = store.planId === job.plan_id;
  address({ plan: store.planId });
  if (!result || !current) return current;
  if (job.kind === "refinement") {
    address({ plan: result.id });
    await openPlan(result.id);
    return true;
  }
  const at = `v1/jobs/${job.id}/figures`;
  const found = { accuracy: `${at}/accuracy`, consistency: `${at}/consistency` };
  if (result.series) found.errors = `${at}/errors`;
  await charts.add(found, { show: "accuracy" });
  return true;
}

/** Say in the address what is on show and followed, so that a link or a reload goes on with it. */
function address({ plan }) {
  const parts = new URLSearchParams();
  if (plan) parts.set("plan", plan);
  if (following) parts.set("job", following);
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
  if (file) attempt(() => openFile(file));
});
byId("undo").addEventListener("click", () => store.undo());
byId("redo").addEventListener("click", () => store.redo());
byId("share").addEventListener("click", () =>
  store.scenario && attempt(async () => {
    await storePlan();
    await navigator.clipboard.writeText(location.href).catch(() => {});
    notice(`Link to this plan: ${location.href}`);
  }),
);
askForKeys(() => {
  // an edit that waits for the key is not lost to the first example
  if (store.scenario) store.edit(store.scenario, { step: false });
  else attempt(start);
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => attempt(redraw));

for (const name of ["opened", "scenario", "plan"]) {
  store.addEventListener(name, () => {
    allow("undo", store.canUndo);
    allow("redo", store.canRedo);
    allow("share", true);
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
    // that a key is wanted is no fault; the form for it is there
    notice(error.message, { fault: error.status !== 401 });
  } finally {
    busy(false);
  }
}

/** Let a button be pressed or not; one that has the focus keeps it. */
function allow(id, may) {
  byId(id).setAttribute("aria-disabled", !may);
}

/** Count what there is to wait for. */
function busy(flag) {
  waiting += flag ? 1 : -1;
  byId("workspace").setAttribute("aria-busy", waiting > 0);
}

async function start() {
  const asked = new URLSearchParams(location.search);
  following = asked.get("job");
  if (asked.get("plan")) await openPlan(asked.get("plan"));
  else await openExample(FIRST_EXAMPLE);
  performance.mark("ready");
  if (asked.get("job")) work.resume(asked.get("job")).catch((error) => notice(error.message, { fault: true }));
}

/** Draw everything anew, in the colours of the theme. */
async function redraw() {
  const { plan, planId, scenario } = store;
  if (!plan) return;
  const figures = planId ? await figuresOf(`v1/plans/${planId}`) : (await Planner.preview(scenario)).figures;
  if (store.plan === plan) store.judged(plan, figures, { quick: false });
}

attempt(start);
