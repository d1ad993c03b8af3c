// What the service keeps of one's work: plans, jobs and recordings, listed, opened, renamed, deleted.

import { alert, attemptAt, button, byId, dialogue, element, notice, onceChosen, present, shown, table, timeOf } from "./elements.js";
import { jobsAt, outcomeOf } from "./jobs.js";
import { ask, askJson, postOnce } from "./service.js";
import { smallMap } from "./small_map.js";
import { STUDIES } from "./tables.js";
import { tabs } from "./tabs.js";

/** Jobs about no plan that have a part of the page, by the name that the address gives it. */
const ADDRESSED = { design: "design" };

/** The dialogue of what is kept; `open(planId)` opens a plan, `compare(plan)` draws one beside the plan on show, and
 * `showReplay(report)` shows the replay of a recording instead of it.
 *
 * Returns what shows a kind of work. */
export function offerKeptWork(how) {
  byId("kept").addEventListener("click", () => show(how));
  return (kind) => show(how, kind);
}

/** Send the archive of a recording, which the service keeps. */
export async function sendRecording(file) {
  notice(`Sending ${file.name} …`);
  await ask("POST", "v1/recordings", { body: file, type: archiveType(file.name) });
  notice(`${file.name} is kept.`);
}

function show({ open, compare, showReplay }, kind = "plans") {
  const list = element("div", { class: "tabs", role: "tablist", "aria-label": "Kept work" });
  const listed = element("div", { id: "kept-list", role: "tabpanel" });
  const used = element("p", { id: "usage", class: "hint" });
  const fault = alert();
  const report = ({ id }, { name }) => element("a", { href: `v1/jobs/${id}/result`, download: `${name}.report.json` }, "Report");
  const replays = jobsAt("replay-job", {
    ended: async (job, result) => result && [act("Show on the map", () => onMap(result)), await outcomeOf(job), report(job, result)],
  });
  /** Each kind of work: its title, the columns of a row, and what can be done with it. */
  const kinds = {
    plans: {
      title: "Plans",
      heads: ["Name", "Verdict", "Worst error", "Vehicles", "Date"],
      cells: ({ id, name, outline, go, worst_predicted_rms_m: error, vehicles, parent_id: parent, created_at: made }) => [
        [outline && smallMap(outline), act(name || "without a name", () => open(id).then(close)), parent && element("span", { class: "hint block" }, "refined from another plan")],
        go === null ? "—" : go ? "GO" : "NO-GO",
        shown(error, "m"),
        `${vehicles}`,
        timeOf(made),
      ],
      acts: (row) => [act("Compare", async () => compare(await askJson("GET", `v1/plans/${row.id}`).finally(close))), rename(row), remove(row)],
    },
    jobs: {
      title: "Jobs",
      heads: ["Kind", "State", "Begun"],
      cells: ({ kind, state, created_at: made }) => [STUDIES[kind].title, state, timeOf(made)],
      acts: (row) => [
        addressOf(row) && element("a", { href: addressOf(row) }, "Open"),
        row.recording_id && row.result && act("Show on the map", async () => onMap(await askJson("GET", `v1/jobs/${row.id}/result`))),
        row.result && element("a", { href: row.result, download: `${row.kind}.json` }, "Result"),
        remove(row),
      ],
    },
    recordings: {
      title: "Recordings",
      heads: ["Name", "Robots", "Length", "Sightings", "Sent"],
      cells: ({ name, robots, duration_s: length, bearings, distances, created_at: sent }) => [
        name,
        robots.join(", "),
        shown(length, "s"),
        `${bearings + distances}`,
        timeOf(sent),
      ],
      acts: (row) => [act("Replay", (pressed) => replay(row, pressed)), rename(row), remove(row)],
    },
  };
  const dialog = dialogue("kept", "Kept work", { class: "broad" }, list, listed, used, fault, ...replays.elements);
  const close = () => dialog.close();
  const titles = Object.fromEntries(Object.entries(kinds).map(([name, { title }]) => [name, title]));
  const parts = tabs(list, titles, () => attemptAt(fault, renew), () => "kept-list");
  parts.choose(kind);
  parts.show(Object.keys(titles));

  function act(text, task) {
    return button(text, ({ currentTarget }) => attemptAt(fault, () => task(currentTarget)), { class: "small" });
  }

  /** Show the newest of the kind that is chosen. */
  function renew() {
    return more(`v1/${parts.current()}?limit=20`, []);
  }

  /** Show a page of work, below what was listed before it. */
  async function more(at, before) {
    const kind = parts.current();
    const { title, heads, cells, acts } = kinds[kind];
    listed.setAttribute("aria-labelledby", `tab-${kind}`);
    const [{ items, next }, usage] = await Promise.all([askJson("GET", at), askJson("GET", "v1/usage")]);
    if (kind !== parts.current()) return;
    used.textContent = usageOf(usage);
    const all = [...before, ...items];
    const groups = [...Map.groupBy(all, ({ id, name }) => (kind === "plans" && name) || id).values()];
    const rows = groups.flat().map((work) => [...cells(work), element("div", { class: "row" }, acts(work))]);
    const lines = table([...heads, ""], rows);
    fold([...lines.tBodies[0].rows], groups);
    const kept = element("div", { class: "front", tabindex: "0", role: "region", "aria-label": title }, lines);
    const further = next && button("More", () => attemptAt(fault, () => more(next.replace(/^\//, ""), all)));
    listed.replaceChildren(...present([kind === "recordings" && upload(), all.length ? kept : element("p", {}, "None is kept."), further]));
  }

  function rename({ id, name }) {
    return act("Rename", () => {
      const given = prompt("New name", name);
      return given !== null && change("PATCH", id, { body: JSON.stringify({ name: given }) });
    });
  }

  function remove({ id, name, kind }) {
    return act("Delete", () => confirm(`Delete ${name || kind || "this plan"}? This can't be undone.`) && change("DELETE", id));
  }

  async function change(method, id, how = {}) {
    await ask(method, `v1/${parts.current()}/${id}`, how);
    await renew();
  }

  function upload() {
    const file = element("input", { id: "recording-file", class: "unseen", type: "file", accept: ".zip,.tar,.tgz,.gz" });
    onceChosen(file, (chosen) => attemptAt(fault, () => sendRecording(chosen).then(renew)));
    const label = element("label", { class: "button", for: "recording-file" }, "Send a recording …");
    return element("p", {}, file, label, element("span", { class: "hint" }, " A zip or tar archive of its folder."));
  }

  function onMap(result) {
    if (!result.paths) throw new Error("This replay has no paths: replay the recording again.");
    close();
    showReplay(result);
  }

  /** Run the filter on a recording. */
  async function replay({ id }, pressed) {
    replays.clear();
    const job = await postOnce(`v1/recordings/${id}/replays`, { series: true });
    await replays.follow(job, pressed);
  }
}

/** Fold the rows below the first of each group, which gets a button for them. */
function fold(rows, groups) {
  for (const { length } of groups) {
    const [newest, ...earlier] = rows.splice(0, length);
    const turn = () => {
      for (const row of earlier) row.hidden = !row.hidden;
      opener.setAttribute("aria-expanded", !earlier[0].hidden);
    };
    const opener = button(`${earlier.length} earlier`, turn, { class: "small" });
    if (!earlier.length) continue;
    newest.cells[0].append(opener);
    turn();
  }
}

/** What is kept and was computed, and the most allowed. */
function usageOf({ bytes, max_bytes: most, computing_s: computing, max_job_seconds: longest }) {
  const kept = Object.values(bytes).reduce((sum, size) => sum + size, 0);
  return `Kept: ${shown(kept / 2 ** 20, "MiB")} of ${shown(most / 2 ** 20, "MiB")}. Computing time of jobs in 24 hours: ${shown(computing / 3600, "h")} of ${shown(longest / 3600, "h")}.`;
}

/** The address that shows a job with what it is about; null where the page has no place for it. */
function addressOf({ kind, id, plan_id: planId, result_plan_id: refined }) {
  if (kind in ADDRESSED) return `?${ADDRESSED[kind]}=${id}`;
  return planId ? `?plan=${refined ?? planId}&job=${id}` : null;
}

function archiveType(name) {
  if (/\.zip$/i.test(name)) return "application/zip";
  return /gz$/i.test(name) ? "application/gzip" : "application/x-tar";
}
