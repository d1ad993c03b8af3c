// What is around the map: the bar, the panels beside it, the figures and the player, and how they hear of one another.

import { offerCharts } from "./charts.js";
import { offerComparison } from "./comparison.js";
import { offerWaysOn } from "./dead_link.js";
import { offerDegrees } from "./coordinates.js";
import { offerDesigns } from "./design.js";
import { offerPreflight } from "./preflight.js";
import { offerEditor } from "./editor.js";
import { attempt, byId, notice, noticeIsFault, onceChosen, takeDropped } from "./elements.js";
import { Handles } from "./handles.js";
import { offerKeptWork } from "./kept_work.js";
import { offerLosses } from "./losses.js";
import { offerNaming } from "./naming.js";
import { offerNewTeam } from "./new_team.js";
import { FIRST_EXAMPLE } from "./opening.js";
import { Planner } from "./planner.js";
import { offerPlayer } from "./player.js";
import { offerReplays } from "./replayed.js";
import { offerLink, offerSave, storing } from "./sharing.js";
import { unsavedWork } from "./session.js";
import { listenForKeys } from "./shortcuts.js";
import { STUDIES } from "./tables.js";
import { tabs } from "./tabs.js";
import { traceErrors } from "./trace.js";
import { Tools } from "./tools.js";
import { showVerdicts, wayBack } from "./verdict.js";
import { offerWork } from "./work.js";

const PARTS = { scenario: "Scenario", verdict: "Verdict", run: "Run", design: "Design", preflight: "Preflight" };

/** Make all panels; returns what goes on with jobs and designs, and what shows that a link leads nowhere. */
export function makePanels({ store, map, address, opening }) {
  const storePlan = storing(store, address);
  const charts = offerCharts(store);
  offerEditor(store, storePlan);
  const player = offerPlayer(store, map, charts);
  byId("ellipses").addEventListener("click", async () => (await import("./ellipses.js")).toggled(store, map));
  showVerdicts(store);
  traceErrors(store, Planner.preview);
  const tools = new Tools(store, map.canvas);
  new Handles(store, map.canvas, (grip) => tools.uses(grip));
  listenForKeys(store, tools);
  const parts = offerParts(store);
  const resumeWork = offerWork(store, storePlan, { began, changed, ended });
  const resumeDesigns = offerDesigns(store, (plan, name) => attempt(() => opening.formation(plan, name)), (jobId) => name("designed", jobId));
  offerNewTeam((scenario, change) => opening.team(scenario, change));
  const showKept = offerKeptWork({ open: (planId) => opening.plan(planId, { opened: () => address.write() }), compare: offerComparison(store), showReplay: offerReplays(store, map, player) });
  opening.showRecordings = () => showKept("recordings");
  offerPreflight(store, storePlan);
  offerLosses(store, storePlan);
  offerNaming(store);
  offerSave(store, storePlan);
  offerLink(store, storePlan);
  offerBar(store, opening);
  offerDegrees(store);
  const showDeadLink = offerWaysOn(store, {
    edit: () => attempt(async () => (await opening.edit()) || opening.example(FIRST_EXAMPLE)),
    example: () => attempt(() => opening.example(FIRST_EXAMPLE)),
  });
  // last: over a slow line it would keep the map and the panels waiting
  document.fonts.add(new FontFace("Inter", `url(${new URL("./vendor/inter.woff2", import.meta.url)})`, { weight: "100 900", display: "swap" }));
  return { resumeJob, resumeDesign, showDeadLink, offerLeft, greet: async () => (await import("./welcome.js")).welcome(store, player) };

  /** Offer what closed tabs left. */
  async function offerLeft() {
    const works = await unsavedWork();
    if (works.length) (await import("./unsaved.js")).offerUnsaved(store, works, (work) => opening.edit(work));
  }

  /** Let the address name a job or a design as what is followed; null ends it. */
  function name(what, value) {
    address[what] = value;
    address.write();
  }

  function began(job) {
    name("followed", { id: job.id, ended: false });
  }

  /** Show what a job at work has come to so far, if the plan on show is the one it is about. */
  async function changed(job, { best, finished, progress }) {
    const own = address.followed;
    const wanted = () => address.followed === own && store.planId === job.plan_id;
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
    const names = figuresOf(STUDIES[job.kind], given);
    const addresses = names.map((one) => [one, `v1/jobs/${job.id}/figures/${one}`]);
    await charts.add(Object.fromEntries(addresses), { show: again ? "" : names[0], wanted });
    if (names.length && wanted()) charts.open();
  }

  /** Show what a job came to; resolves with whether the plan on show is still the one it was about. */
  async function ended(job, result) {
    const current = store.planId !== null && [job.plan_id, job.result_plan_id].includes(store.planId);
    const again = Boolean(address.followed?.finished);
    const outcome = current ? { id: job.id, ended: true } : null;
    name("followed", outcome);
    if (STUDIES[job.kind].ends_early) store.compare(null);
    if (result && !STUDIES[job.kind].makes_plan) store.reported(job.id);
    if (!result || !current) return current;
    if (job.result_plan_id) {
      if (store.planId !== result.id) await openRefined(result.id, outcome);
      return true;
    }
    await addFigures(job, result, { again });
    player.offer(result);
    return true;
  }

  /** Open what a refinement came to; the browser's Back leads to the plan before it. */
  async function openRefined(planId, outcome) {
    name("followed", null);
    await opening.plan(planId, {
      opened: () => {
        address.followed = outcome;
        address.write({ push: true });
      },
    });
  }

  /** Go on with a job about the plan on show, or show what it came to. */
  function resumeJob(id) {
    parts.choose("run");
    return resume(resumeWork, id, "followed", { id, ended: false });
  }

  function resumeDesign(id, show) {
    if (show) parts.choose("design");
    return resume(resumeDesigns, id, "designed", id);
  }

  /** Go on with a job in its panel; the address names it, unless it is not there. */
  async function resume(panel, jobId, what, value) {
    name(what, value);
    try {
      await panel(jobId);
    } catch (error) {
      name(what, null);
      notice(error.message, { fault: true });
    }
  }
}

/** The figures that a report has: of some, a part of it is needed. */
function figuresOf({ figures }, report) {
  const part = (path) => path.split(".").reduce((value, key) => value?.[key], report);
  const has = ({ part: path }) => {
    const value = path ? part(path) : true;
    return Array.isArray(value) ? value.length > 0 : Boolean(value);
  };
  return figures.filter(has).map(({ name }) => name);
}

/** Let parts be chosen and the sheet be opened; what is selected on the map shows its fields. Returns `{ choose(name) }`. */
function offerParts(store) {
  const parts = tabs(byId("parts"), PARTS, (name) => {
    for (const other of Object.keys(PARTS)) byId(`part-${other}`).hidden = other !== name;
  }, (name) => `part-${name}`);
  parts.show(Object.keys(PARTS));
  const sheet = byId("sheet");
  sheet.addEventListener("click", () => {
    const open = sheet.getAttribute("aria-expanded") !== "true";
    sheet.setAttribute("aria-expanded", open);
    sheet.textContent = open ? "Map" : "Details";
    // where the page scrolls
    if (open) sheet.scrollIntoView({ block: "start" });
  });
  // neither a drag, a design nor a job at work is left for the fields
  const stays = () => parts.current() === "design" || (parts.current() === "run" && byId("work").querySelector(".running:not([hidden])"));
  store.on(["selected"], ({ dragged }) => store.selected && !dragged && !stays() && parts.choose("scenario"));
  return parts;
}

/** The bar above the map, and the messages over it. */
function offerBar(store, opening) {
  onceChosen(byId("examples"), (name) => attempt(() => opening.example(name)));
  const open = (file) => attempt(() => opening.file(file));
  onceChosen(byId("upload"), open);
  byId("open").addEventListener("click", () => byId("upload").click());
  // what was chosen in the menu closes it
  for (const name of ["click", "change"]) byId("more").addEventListener(name, ({ target }) => target.closest(name === "click" ? "button" : "select") && byId("more").hidePopover());
  takeDropped(byId("workspace"), open);
  byId("dismiss").addEventListener("click", () => notice(""));
  byId("undo").addEventListener("click", () => store.undo());
  byId("redo").addEventListener("click", () => store.redo());
  addEventListener("beforeunload", (event) => {
    if (store.unsaved) event.preventDefault();
  });
  // nothing that was pressed before they heard of it is lost
  for (const id of ["new", "examples", "open", "kept"]) byId(id).disabled = false;
  // a button that has the focus keeps it
  const allow = (id, may) => byId(id).setAttribute("aria-disabled", !may);
  store.on(["opened", "scenario", "plan", "recalled"], () => {
    allow("undo", store.canUndo);
    allow("redo", store.canRedo);
    allow("share", true);
  });
  store.on(["scenario"], ({ lost, restored }) => {
    if (lost) notice(`Edited: phases are computed anew. ${wayBack(store.lost)}`);
    // what was confirmed of the plan before is read by now
    else if (restored || !noticeIsFault()) notice("");
  });
  // where the findings are out of sight, or hold nothing of it
  store.on(["faults"], ({ message, why, faults }) => (why !== "fault" || !faults.length || !byId("findings").checkVisibility()) && notice(message, { fault: true }));
  store.on(["plan"], () => noticeIsFault() && notice(""));
}
