// A team designed from a brief: the front as it grows, and the formations found.

import { briefOn } from "./brief.js";
import { button, byId, element, present, shown, table } from "./elements.js";
import { jobsAt } from "./jobs.js";
import { RequestForm } from "./requests.js";

const KIND = "design";

/** The panel of designs over a store's map; returns what goes on with one by its identifier.
 *
 * `open(plan, name)` shows a formation on the map; `followed(jobId)` is called with the design that the panel shows.
 */
export function offerDesigns(store, open, followed) {
  const brief = briefOn(store);
  const front = element("div", { class: "front", role: "region", tabindex: "0", "aria-label": "Teams found" });
  const jobs = jobsAt("design-job", {
    forms: (handIn) => [new RequestForm(KIND, byId("design-form"), { read: brief.asked, handIn: (form, request) => brief.whole() && handIn(form, request) })],
    addressOf: () => "v1/designs",
    began: (job) => {
      front.replaceChildren();
      followed(job.id);
    },
    changed: (job, { front: found }) => found && front.replaceChildren(frontOf(found, job.request.need.worst_rms_m, open)),
    ended: (job, found) => {
      followed(found && job.id);
      if (!found) return null;
      const teams = found.front.length ? frontOf(found.front, found.brief.need.worst_rms_m, open, found.best) : null;
      front.replaceChildren(...present([teams, purchasesOf(found.purchases, open)]));
      return verdictOf(found, open);
    },
  });
  byId("design").append(...jobs.elements, front);
  return (jobId) =>
    jobs.resume(jobId, ({ kind, request }) => {
      if (kind !== KIND) throw new Error("The address names a job that is no design.");
      brief.take(request);
    });
}

/** What the service found, in words, with a button that opens it. */
function verdictOf({ status, binding, proof, best, plan, cut_short: short, brief: { need } }, open) {
  const met = status === "met";
  const words = { met: "Met", not_found: "No team found", impossible: "Impossible" };
  const team = best && teamOf(best);
  return [
    element("p", { class: `badge ${met ? "good" : "bad"}` }, `${words[status]}: need ${shown(need.worst_rms_m, "m")}${met ? `, ${team}` : ""}`),
    proof && element("p", {}, proof.reason),
    !met && !proof && element("p", {}, `What decides: ${binding}${short ? "; ended early" : ""}.`),
    best && element("p", {}, `${met ? "The winner" : "The best found"}: ${team}, predicted ${shown(best.predicted_worst_rms_m, "m")}${tried(best)} for the worst vehicle; cost ${shown(best.cost)}.`),
    plan && button(met ? "Open the winner" : "Open the best found", () => open(plan, team)),
  ];
}

/** The front as a table: a team's formation opens from its error, once the design is done. */
function frontOf(front, need, open, best = null) {
  const [columns, rows] = ["landmarks", "vehicles"].map((key) => [...new Set(front.map((one) => one[key]))].sort((a, b) => a - b));
  const cell = (vehicles, landmarks) => {
    const one = front.find((team) => team.vehicles === vehicles && team.landmarks === landmarks);
    return one && cellOf(one, need, open, best);
  };
  const caption = element("caption", {}, "Least predicted error (m) of the worst vehicle, before refinement. ✓ within the need, ★ chosen, — none fits.");
  const made = table(columns.map(String), rows.map((count) => [`${count}`, ...columns.map((sites) => cell(count, sites))]), caption);
  const above = [element("th", { scope: "col", rowspan: 2 }, "Vehicles"), element("th", { scope: "colgroup", colspan: columns.length }, "Landmarks")];
  made.tHead.prepend(element("tr", {}, above));
  return made;
}

function cellOf(one, need, open, best) {
  if (one.worst_rms_m === null) return "—";
  const chosen = best && best.vehicles === one.vehicles && best.landmarks === one.landmarks;
  const text = `${shown(one.worst_rms_m)}${one.worst_rms_m <= need ? " ✓" : ""}${chosen ? " ★" : ""}`;
  if (!one.formation) return text;
  const about = `${teamOf(one)}: ${shown(one.worst_rms_m, "m")}; open this formation`;
  return button(text, () => open(one.formation, teamOf(one)), { class: "small", "aria-label": about });
}

function teamOf({ vehicles, landmarks }) {
  return `${vehicles} vehicles and ${landmarks} landmarks`;
}

function tried({ validated_worst_rms_m: validated, flown_worst_rms_m: flown }) {
  return (validated === null ? "" : `, validated ${shown(validated, "m")}`) + (flown === null ? "" : `, flown ${shown(flown, "m")}`);
}

/** What changes of the brief would bring. */
function purchasesOf(purchases, open) {
  if (!purchases.length) return [];
  const row = ({ change, worst_rms_m: worst, met, formation }) => {
    const link = button("Open", () => open(formation, change), { class: "small" });
    return element("li", {}, `${change}: ${shown(worst, "m")}${met ? ", which meets the need" : ""} `, link);
  };
  return [element("p", {}, "What would help:"), element("ul", {}, purchases.map(row))];
}
