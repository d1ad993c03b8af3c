// A team designed from a brief: the brief's text, the front as it grows, and the formations found.

import { byId, element, notice, shown } from "./elements.js";
import { RequestForm } from "./requests.js";
import { RunningJob } from "./running_job.js";
import { ask, askJson, patiently, postOnce } from "./service.js";
import { ENDED } from "./tables.js";

const BRIEFS = {
  "multirotors-over-a-field": "Multirotors over a field",
  "aircraft-in-a-corridor": "Aircraft in a corridor",
  "rovers-between-shelves": "Rovers between shelves",
};

/** The panel of designs.
 *
 * `open(plan, name)` shows a formation on the map; `followed(jobId)` is called with the design that the panel shows.
 */
export class DesignPanel {
  #open;
  #followed;
  #text = element("textarea", { id: "brief", rows: 7, spellcheck: "false", "aria-describedby": "brief-fault" });
  #form;
  #fault = element("p", { class: "fault", role: "alert" });
  #running = new RunningJob("design-job", this.#fault);
  #outcome = element("div", { role: "status" });
  #front = element("div", { class: "front", role: "region", tabindex: "0", "aria-label": "Teams found" });

  constructor(open, followed) {
    this.#open = open;
    this.#followed = followed;
    this.#form = new RequestForm("design", "Design", "State a field, vehicles, sensors, a purpose and the error you accept; see which team that takes.", {
      // a fault of the text as a whole has no path
      fields: { "": this.#text },
      read: () => this.#text.value,
      rows: [this.#sources(), element("label", { for: "brief" }, "Brief (YAML or JSON)"), this.#text, element("p", { class: "fault", id: "brief-fault" })],
      handIn: (_form, brief) => this.#handIn(brief),
    });
    byId("design").append(this.#form.element, this.#fault, this.#running.element, this.#outcome, this.#front);
  }

  /** Show a design again, as after a reload. */
  async resume(jobId) {
    const job = await askJson("GET", `v1/jobs/${encodeURIComponent(jobId)}`);
    if (job.kind !== this.#form.kind) throw new Error("The address names a job that is no design.");
    this.#text.value = JSON.stringify(job.request, null, 1);
    await (ENDED.includes(job.state) ? this.#conclude(job) : this.#follow(job));
  }

  /** Where a brief's text may come from. */
  #sources() {
    const examples = Object.entries(BRIEFS).map(([name, title]) => element("option", { value: name }, title));
    const example = element("select", { "aria-label": "Example brief" }, element("option", { value: "" }, "Example brief …"), ...examples);
    example.addEventListener("change", async () => {
      if (!example.value) return;
      try {
        const answer = await ask("GET", `assets/briefs/${example.value}.yaml`, { accept: "application/yaml" });
        this.#text.value = await answer.text();
      } catch (error) {
        this.#fault.textContent = error.message;
      }
      example.value = "";
    });
    const file = element("input", { id: "brief-file", class: "unseen", type: "file", accept: ".yaml,.yml,.json,application/yaml,application/json" });
    file.addEventListener("change", async () => {
      const [chosen] = file.files;
      file.value = "";
      if (!chosen) return;
      try {
        this.#text.value = await chosen.text();
      } catch (error) {
        this.#fault.textContent = error.message;
      }
    });
    return element("div", { class: "row" }, example, file, element("label", { class: "button", for: "brief-file" }, "Open a brief …"));
  }

  async #handIn(brief) {
    this.#clear();
    this.#form.button.disabled = true;
    try {
      await this.#follow(await postOnce("v1/designs", brief), { focus: true });
    } catch (error) {
      this.#form.showFault(error);
    } finally {
      this.#form.button.disabled = false;
      if (document.activeElement === document.body) this.#form.button.focus();
    }
  }

  async #follow(job, { focus = false } = {}) {
    this.#followed(job.id);
    this.#form.button.disabled = true;
    const need = job.request.need.worst_rms_m;
    try {
      const changed = ({ front }) => front && this.#front.replaceChildren(this.#table(front, need));
      await this.#conclude(await this.#running.follow(job, { focus, changed }));
    } catch (error) {
      this.#fault.textContent = error.message;
    } finally {
      const focused = this.#running.close();
      this.#form.button.disabled = false;
      if (focus && focused) this.#form.button.focus();
    }
  }

  async #conclude(job) {
    if (job.state !== "succeeded") {
      this.#followed(null);
      if (job.state === "failed") this.#fault.textContent = `Design failed: ${job.error.detail}`;
      else notice("Design cancelled.");
      return;
    }
    this.#followed(job.id);
    const found = await patiently(() => askJson("GET", `v1/jobs/${job.id}/result`));
    this.#outcome.replaceChildren(...this.#verdict(found));
    this.#front.replaceChildren(...(found.front.length ? [this.#table(found.front, found.brief.need.worst_rms_m, found.best)] : []), ...offered(found.purchases, this.#open));
    notice("Design done.");
  }

  #verdict({ status, binding, proof, best, plan, cut_short: short, brief: { need } }) {
    const met = status === "met";
    const words = { met: "Met", not_found: "No team found", impossible: "Impossible" };
    const team = best && teamOf(best);
    return [
      element("p", { class: `badge ${met ? "good" : "bad"}` }, `${words[status]}: need ${shown(need.worst_rms_m, "m")}${met ? `, ${team}` : ""}`),
      proof && element("p", {}, proof.reason),
      !met && !proof && element("p", {}, `What decides: ${binding}${short ? "; ended early" : ""}.`),
      best && element("p", {}, `${met ? "The winner" : "The best found"}: ${team}, predicted ${shown(best.predicted_worst_rms_m, "m")}${tried(best)} for the worst vehicle; cost ${shown(best.cost)}.`),
      plan && element("button", { type: "button", onclick: () => this.#open(plan, team) }, met ? "Open the winner" : "Open the best found"),
    ].filter(Boolean);
  }

  /** The front as a table: a team's formation opens from its error, once the design is done. */
  #table(front, need, best = null) {
    const columns = [...new Set(front.map((one) => one.landmarks))].sort((a, b) => a - b);
    const rows = [...new Set(front.map((one) => one.vehicles))].sort((a, b) => a - b);
    const cell = (vehicles, landmarks) => {
      const one = front.find((team) => team.vehicles === vehicles && team.landmarks === landmarks);
      return element("td", {}, one ? this.#cell(one, need, best) : "");
    };
    const head = (text, scope, span = {}) => element("th", { scope, ...span }, text);
    return element(
      "table",
      { class: "losses" },
      element("caption", {}, "Least predicted error (m) of the worst vehicle, before refinement. ✓ within the need, ★ chosen, — none fits."),
      element(
        "thead",
        {},
        element("tr", {}, head("Vehicles", "col", { rowspan: 2 }), head("Landmarks", "colgroup", { colspan: columns.length })),
        element("tr", {}, ...columns.map((one) => head(`${one}`, "col"))),
      ),
      element("tbody", {}, ...rows.map((count) => element("tr", {}, head(`${count}`, "row"), ...columns.map((sites) => cell(count, sites))))),
    );
  }

  #cell(one, need, best) {
    if (one.worst_rms_m === null) return "—";
    const chosen = best && best.vehicles === one.vehicles && best.landmarks === one.landmarks;
    const text = `${Number(one.worst_rms_m.toPrecision(3))}${one.worst_rms_m <= need ? " ✓" : ""}${chosen ? " ★" : ""}`;
    if (!one.formation) return text;
    const about = `${teamOf(one)}: ${shown(one.worst_rms_m, "m")}; open this formation`;
    return element("button", { type: "button", class: "small", "aria-label": about, onclick: () => this.#open(one.formation, teamOf(one)) }, text);
  }

  #clear() {
    this.#fault.textContent = "";
    this.#outcome.replaceChildren();
    this.#front.replaceChildren();
  }
}

function teamOf({ vehicles, landmarks }) {
  return `${vehicles} vehicles and ${landmarks} landmarks`;
}

function tried({ validated_worst_rms_m: validated, flown_worst_rms_m: flown }) {
  return (validated === null ? "" : `, validated ${shown(validated, "m")}`) + (flown === null ? "" : `, flown ${shown(flown, "m")}`);
}

/** What changes of the brief would bring. */
function offered(purchases, open) {
  if (!purchases.length) return [];
  const row = ({ change, worst_rms_m: worst, met, formation }) => {
    const link = element("button", { type: "button", class: "small", onclick: () => open(formation, change) }, "Open");
    return element("li", {}, `${change}: ${shown(worst, "m")}${met ? ", which meets the need" : ""} `, link);
  };
  return [element("p", {}, "What would help:"), element("ul", {}, ...purchases.map(row))];
}
