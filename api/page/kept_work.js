// What the service keeps of one's work: plans, jobs and recordings, listed, opened, renamed, deleted.

import { byId, element, notice, shown } from "./elements.js";
import { RunningJob } from "./running_job.js";
import { ask, askJson, patiently, postOnce } from "./service.js";
import { JOB_KINDS } from "./tables.js";
import { tabs } from "./tabs.js";

/** Jobs about no plan that have a part of the page, by the name that the address gives it. */
const ADDRESSED = { design: "design" };

/** The dialogue of what is kept; `open(planId)` opens a plan, `compare(plan)` draws one beside the plan on show. */
export function offerKeptWork({ open, compare }) {
  byId("kept").addEventListener("click", () => new KeptWork({ open, compare }));
}

class KeptWork {
  #list = element("div", { id: "kept-list", role: "tabpanel" });
  #fault = element("p", { class: "fault", role: "alert" });
  #running = new RunningJob("replay-job", this.#fault);
  #outcome = element("div", { role: "status" });
  #dialogue;
  #tabs;
  /** Each kind of work: its title, where it is, and the columns and buttons of a row. */
  #kinds = {};

  constructor({ open, compare }) {
    this.#kinds = {
      plans: {
        title: "Plans",
        heads: ["Name", "Verdict", "Error", "Vehicles", "Made"],
        cells: ({ id, name, go, predicted_rms_m: error, vehicles, parent_id: parent, created_at: made }) => [
          [this.#act(name || "without a name", () => this.#close(() => open(id))), parent ? element("span", { class: "hint block" }, "refined from another plan") : null],
          go === null ? "—" : go ? "GO" : "NO-GO",
          shown(error, "m"),
          `${vehicles}`,
          timeOf(made),
        ],
        more: (row) => [this.#act("Compare", () => this.#close(async () => compare(await askJson("GET", `v1/plans/${row.id}`)))), this.#rename(row), this.#delete(row)],
      },
      jobs: {
        title: "Jobs",
        heads: ["Kind", "State", "Begun"],
        cells: ({ kind, state, created_at: made }) => [JOB_KINDS[kind].title, state, timeOf(made)],
        more: (row) => [addressOf(row) ? element("a", { href: addressOf(row) }, "Open") : null, row.result ? element("a", { href: row.result, download: `${row.kind}.json` }, "Result") : null, this.#delete(row)],
      },
      recordings: {
        title: "Recordings",
        heads: ["Name", "Robots", "Length", "Sightings", "Sent"],
        cells: ({ name, robots, duration_s: length, bearings, distances, created_at: sent }) => [name, robots.join(", "), shown(length, "s"), `${bearings + distances}`, timeOf(sent)],
        more: (row) => [this.#act("Replay", () => this.#replay(row)), this.#rename(row), this.#delete(row)],
      },
    };
    const list = element("div", { class: "tabs", role: "tablist", "aria-label": "Kept work" });
    const close = element("button", { type: "button", class: "small", "aria-label": "Close", onclick: () => this.#dialogue.close() }, "×");
    this.#dialogue = element(
      "dialog",
      { class: "broad", "aria-labelledby": "kept-title" },
      element("div", { class: "title-row" }, element("h2", { id: "kept-title" }, "Kept work"), close),
      list,
      this.#list,
      this.#fault,
      this.#running.element,
      this.#outcome,
    );
    this.#dialogue.addEventListener("close", () => this.#dialogue.remove());
    document.body.append(this.#dialogue);
    const titles = Object.fromEntries(Object.entries(this.#kinds).map(([name, { title }]) => [name, title]));
    this.#tabs = tabs(list, titles, () => this.#do(() => this.#show()), () => "kept-list");
    this.#dialogue.showModal();
    this.#tabs.show(Object.keys(titles));
  }

  /** Show the newest of the kind that is chosen, or those after a page. */
  async #show(at = `v1/${this.#tabs.current()}?limit=20`, rows = element("tbody", {})) {
    const kind = this.#tabs.current();
    const { heads, cells, more } = this.#kinds[kind];
    this.#list.setAttribute("aria-labelledby", `tab-${kind}`);
    const { items, next } = await askJson("GET", at);
    if (kind !== this.#tabs.current()) return;
    const row = (one) => element("tr", {}, ...cells(one).map((cell) => element("td", {}, ...[cell].flat())), element("td", { class: "row" }, ...more(one)));
    rows.append(...items.map(row));
    const head = element("tr", {}, ...heads.map((text) => element("th", { scope: "col" }, text)), element("td", {}));
    const further = next ? element("button", { type: "button", onclick: () => this.#do(() => this.#show(next.replace(/^\//, ""), rows)) }, "More") : null;
    const table = element("div", { class: "front", tabindex: "0", role: "region", "aria-label": this.#kinds[kind].title }, element("table", { class: "losses" }, element("thead", {}, head), rows));
    this.#list.replaceChildren(...[kind === "recordings" ? this.#upload() : null, rows.children.length ? table : element("p", {}, "None is kept."), further].filter((one) => one !== null));
  }

  #act(text, task) {
    return element("button", { type: "button", class: "small", onclick: () => this.#do(task) }, text);
  }

  async #do(task) {
    this.#fault.textContent = "";
    try {
      await task();
    } catch (error) {
      this.#fault.textContent = error.message;
    }
  }

  async #close(task) {
    await task();
    this.#dialogue.close();
  }

  #rename(row) {
    const at = `v1/${this.#tabs.current()}/${row.id}`;
    return this.#act("Rename", async () => {
      const name = prompt("New name", row.name);
      if (name === null) return;
      await ask("PATCH", at, { body: JSON.stringify({ name }) });
      await this.#show();
    });
  }

  #delete(row) {
    const at = `v1/${this.#tabs.current()}/${row.id}`;
    return this.#act("Delete", async () => {
      if (!confirm(`Delete ${row.name || row.kind || "this plan"}? This can't be undone.`)) return;
      await ask("DELETE", at);
      await this.#show();
    });
  }

  #upload() {
    const file = element("input", { id: "recording-file", class: "unseen", type: "file", accept: ".zip,.tar,.tgz,.gz" });
    file.addEventListener("change", () =>
      this.#do(async () => {
        const [chosen] = file.files;
        file.value = "";
        if (!chosen) return;
        notice(`Sending ${chosen.name} …`);
        await ask("POST", "v1/recordings", { body: chosen, type: archiveType(chosen.name) });
        notice(`${chosen.name} is kept.`);
        await this.#show();
      }),
    );
    return element("p", {}, file, element("label", { class: "button", for: "recording-file" }, "Send a recording …"), element("span", { class: "hint" }, " A zip or tar archive of its folder."));
  }

  /** Run the filter on a recording; the report says how far off each robot was. */
  async #replay(row) {
    this.#outcome.replaceChildren();
    try {
      const job = await this.#running.follow(await postOnce(`v1/recordings/${row.id}/replays`, {}), { focus: true });
      if (job.state === "failed") throw new Error(job.error.detail);
      if (job.state !== "succeeded") return;
      const { robots } = await patiently(() => askJson("GET", `v1/jobs/${job.id}/result`));
      const errors = robots.map(({ name, rms_m: error, rms_sigma_m: sigma }) => element("li", {}, error === null ? `${name}: ${shown(sigma, "m")} by the filter's own sigma; there is no truth` : `${name}: ${shown(error, "m")} RMS`));
      this.#outcome.replaceChildren(element("p", {}, `Replay of ${row.name}:`), element("ul", {}, ...errors), element("a", { href: `v1/jobs/${job.id}/result`, download: `${row.name}.report.json` }, "Report"));
    } finally {
      this.#running.close();
    }
  }
}

/** The address that shows a job with what it is about; null where the page has no place for it. */
function addressOf({ kind, id, plan_id: planId, result_plan_id: refined }) {
  if (kind in ADDRESSED) return `?${ADDRESSED[kind]}=${id}`;
  return planId ? `?plan=${refined ?? planId}&job=${id}` : null;
}

function timeOf(text) {
  return new Date(text).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" });
}

function archiveType(name) {
  if (/\.zip$/i.test(name)) return "application/zip";
  return /gz$/i.test(name) ? "application/gzip" : "application/x-tar";
}
