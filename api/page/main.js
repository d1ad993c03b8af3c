// The page: what there is on it, and how its parts hear of one another.

import { Charts } from "./charts.js";
import { offerWaysOn } from "./dead_link.js";
import { offerDownloads } from "./downloads.js";
import { DesignPanel } from "./design.js";
import { Editor } from "./editor.js";
import { byId, notice, noticeIsFault, shown } from "./elements.js";
import { offerParts } from "./inspector.js";
import { askForKeys } from "./keys.js";
import { offerKeptWork } from "./kept_work.js";
import { offerLosses } from "./losses.js";
import { FormationMap } from "./map.js";
import { offerNewTeam } from "./new_team.js";
import { Opening } from "./opening.js";
import { Planner } from "./planner.js";
import { Player } from "./player.js";
import { NoPlan, postOnce } from "./service.js";
import { keepOverReloads } from "./session.js";
import { offerLink } from "./sharing.js";
import { listenForKeys } from "./shortcuts.js";
import { Store } from "./store.js";
import { JOB_KINDS } from "./tables.js";
import { showVerdicts, wayBack } from "./verdict.js";
import { Work } from "./work.js";

const FIRST_EXAMPLE = "paper-grid-same";

let waiting = 0;
/** the design on show, which the address names */
let designed = null;
const store = new Store();
const charts = new Charts(store, () => attempt(redraw));
const map = new FormationMap(store);
new Editor(store);
const player = new Player(store, map, charts);
new Planner(store, busy);
showVerdicts(store);
listenForKeys(store, map.tools);
const parts = offerParts(store);
const opening = new Opening(store, charts, address);
const work = new Work(store, storePlan, { began, changed, ended });
const designs = new DesignPanel(
  (plan, name) => attempt(() => opening.formation(plan, name)),
  (jobId) => {
    designed = jobId;
    address();
  },
);
const showDeadLink = offerWaysOn(store, {
  edit: () => attempt(async () => (await opening.edit()) || opening.example(FIRST_EXAMPLE)),
  example: () => attempt(() => opening.example(FIRST_EXAMPLE)),
});
offerNewTeam((scenario, change) => opening.team(scenario, change));
offerKeptWork({ open: (planId) => opening.plan(planId, { opened: address }), compare });
offerDownloads(store, storePlan);
offerLosses(store, storePlan);
offerLink(store, storePlan, attempt);
keepOverReloads(store);

// --- stored plans and jobs ----------------------------------------------------------------------

/** the scenario that is being stored, and the promise of its identifier */
let storing = null;

/** Resolves with the identifier of the plan on show, which is stored, once, if it was not. */
async function storePlan() {
  if (store.planId) return store.planId;
  const { scenario, document } = store;
  if (storing?.scenario !== scenario) storing = { scenario, planId: keepPlan(scenario, document) };
  try {
    return await storing.planId;
  } finally {
    if (storing?.scenario === scenario) storing = null;
  }
}

async function keepPlan(scenario, document) {
  const { id } = await postOnce("v1/plans", document);
  if (store.scenario === scenario) {
    store.stored(id);
    address();
  }
  return id;
}

/** the job that the address names: at work, or ended with its outcome on show; `finished` is the number of first
 * trials that its figures are of, while it runs, and `drawing` whether they are on their way */
let followed = null;

function began(job) {
  followed = { id: job.id, ended: false };
  address();
}

/** Show what a job at work has come to so far, if the plan on show is the one it is about. */
async function changed(job, { best, finished, progress }) {
  const own = followed;
  const wanted = () => followed === own && store.planId === job.plan_id;
  if (!wanted()) return;
  if (best) store.compare(best.formation);
  // the figures of all trials follow the last event
  if (!finished || [progress.total, own.finished].includes(finished) || own.drawing) return;
  const again = Boolean(own.finished);
  Object.assign(own, { finished, drawing: true });
  await addFigures(job, job.request, { again, wanted });
  own.drawing = false;
}

/** Add the figures of a job, those whose parts a report has or a request asks for; `again` keeps the one on show.
 * @param {any} job
 * @param {any} given
 * @param {{again?: boolean, wanted?: () => boolean}} options */
async function addFigures(job, given, { again = false, wanted = () => true } = {}) {
  const names = figuresOf(JOB_KINDS[job.kind], given);
  const addresses = names.map((name) => [name, `v1/jobs/${job.id}/figures/${name}`]);
  await charts.add(Object.fromEntries(addresses), { show: again ? "" : names[0], wanted });
  if (names.length && wanted()) charts.open();
}

/** Show what a job came to; resolves with whether the plan on show is still the one it was about. */
async function ended(job, result) {
  const current = store.planId !== null && [job.plan_id, job.result_plan_id].includes(store.planId);
  const again = Boolean(followed?.finished);
  const outcome = current ? { id: job.id, ended: true } : null;
  followed = outcome;
  address();
  if (JOB_KINDS[job.kind].finishes) store.compare(null);
  if (result && JOB_KINDS[job.kind].reports) store.reported(job.id);
  if (!result || !current) return current;
  if (job.result_plan_id) {
    if (store.planId !== result.id) await openRefined(result.id, outcome);
    return true;
  }
  await addFigures(job, result, { again });
  player.offer(result);
  return true;
}

/** The figures that a report has: of some, a part of it is needed. */
function figuresOf({ figures }, report) {
  const part = (path) => path.split(".").reduce((value, key) => value?.[key], report);
  return Object.keys(figures).filter((name) => {
    const shown = figures[name] ? part(figures[name]) : true;
    return Array.isArray(shown) ? shown.length > 0 : Boolean(shown);
  });
}

/** Open what a refinement came to; the browser's Back leads to the plan before it. */
async function openRefined(planId, outcome) {
  followed = null;
  address();
  await opening.plan(planId, {
    opened: () => {
      followed = outcome;
      address({ push: true });
    },
  });
}

/** Say in the address what is on show and followed, so that a reload goes on with it. */
function address({ push = false } = {}) {
  const parts = new URLSearchParams();
  if (store.planId) parts.set("plan", store.planId);
  if (followed) parts.set("job", followed.id);
  if (designed) parts.set("design", designed);
  const text = parts.toString();
  const query = text ? `?${text}` : "";
  const at = query || location.pathname;
  if (push) history.pushState(null, "", at);
  // browsers are slow at it, and a drag asks at every move
  else if (query !== location.search) history.replaceState(null, "", at);
}

/** Forget an outcome that is no longer of what is on show. */
function settleOutcome() {
  if (followed?.ended) followed = null;
}

// --- the bar ------------------------------------------------------------------------------------

byId("examples").addEventListener("change", (event) => {
  const { value } = event.target;
  if (value) attempt(() => opening.example(value));
  event.target.value = "";
});
byId("upload").addEventListener("change", async (event) => {
  const [file] = event.target.files;
  event.target.value = "";
  if (file) attempt(() => opening.file(file));
});
byId("dismiss").addEventListener("click", () => notice(""));
byId("undo").addEventListener("click", () => store.undo());
byId("redo").addEventListener("click", () => store.redo());
addEventListener("beforeunload", (event) => {
  // what was edited and not stored
  if (store.canUndo && !store.planId) event.preventDefault();
});
askForKeys(() => {
  // an edit that waits for the key is not lost to the first example
  if (store.scenario) store.edit(store.scenario, { step: false });
  else attempt(start);
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => attempt(redraw));

store.on(["opened", "scenario", "plan"], () => {
  allow("undo", store.canUndo);
  allow("redo", store.canRedo);
  allow("share", true);
  byId("map-name").textContent = store.scenario.name || "";
});
store.on(["opened", "scenario"], settleOutcome);
store.on(["scenario"], (detail) => {
  address();
  if (detail.lost) notice(`Edited: phases are computed anew. ${wayBack(store.lost)}`);
  // what was confirmed of the plan before is read by now
  else if (detail.restored || !noticeIsFault()) notice("");
});
store.on(["plan"], (detail) => detail.again && opening.compare(store.plan));
addEventListener("popstate", () => attempt(goTo));
store.on(["faults"], (detail) => notice(detail.message, { fault: true }));
store.on(["plan"], () => noticeIsFault() && notice(""));

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
  if (asked.get("plan")) {
    if (!(await openLinked(asked.get("plan")))) return;
  } else if (!(await opening.edit())) await opening.example(FIRST_EXAMPLE);
  performance.mark("ready");
  if (asked.get("job")) resumeJob(asked.get("job"));
  const design = asked.get("design");
  if (design && !asked.get("job")) parts.choose("design");
  if (design) resume(designs, design, (named) => (designed = named ? design : null));
}

/** Open the plan that the address names; resolves with whether there is one. */
async function openLinked(planId) {
  try {
    await opening.plan(planId);
    return true;
  } catch (error) {
    if (!(error instanceof NoPlan)) throw error;
    if (!store.scenario) {
      showDeadLink();
      return false;
    }
    // beside a plan on show, a message will do
    address();
    throw error;
  }
}

/** Go on with a job about the plan on show, or show what it came to. */
function resumeJob(jobId) {
  parts.choose("run");
  return resume(work, jobId, (named) => (followed = named ? { id: jobId, ended: false } : null));
}

/** Go on with a job in its panel; `name(flag)` decides whether the address names it. */
async function resume(panel, jobId, name) {
  name(true);
  address();
  try {
    await panel.resume(jobId);
  } catch (error) {
    name(false);
    address();
    notice(error.message, { fault: true });
  }
}

/** Show what the address names, after Back or Forward. */
async function goTo() {
  const asked = new URLSearchParams(location.search);
  const planId = asked.get("plan");
  // a jump within the page comes here as well
  if (planId === store.planId) return;
  if (!planId) {
    store.undo();
    return;
  }
  await openLinked(planId);
  if (asked.get("job") && !followed) resumeJob(asked.get("job"));
}

/** Draw another plan beside the one on show, and say how they differ. */
function compare(plan) {
  store.compare(plan);
  const errors = [plan, store.plan].map((one) => shown(one.predicted_rms_m.overall, "m"));
  notice(`Dashed: ${plan.scenario.name || "the other plan"}, predicted ${errors[0]}; here ${errors[1]}.`);
}

/** Draw everything anew, in the colours of the theme. */
async function redraw() {
  const { plan, planId, document } = store;
  if (!plan) return;
  const { figures } = await (planId ? Planner.stored(planId) : Planner.preview(document));
  if (store.plan === plan) store.judged(plan, figures, { quick: false });
  // what took its place meanwhile may have been asked for without figures
  else await redraw();
}

attempt(start);
