// What the plan comes to, in words.

import { byId, element, shown } from "./elements.js";

/** What the verdict on show is not of, by why: what the badge begins with, and a remark. */
const DOUBTS = {
  fault: ["Before the fault", "Of the scenario before the fault."],
  away: ["Waiting for the service, before it", "Of the scenario before your edits, which wait for the service."],
  key: ["Waiting for a key, before it", "Of the scenario before your edits, which wait for a key."],
  typing: ["Before the field half typed", "Of the scenario without the field that is half typed."],
};

/** Fields that are never empty begin with this: those of one vehicle or landmark. */
const NEEDED = "field-chosen-";

const ORIGINS = {
  refined: "refined",
  file: "from a file",
  given: "as given",
};

/** Shows the verdict on a store's plan; one that is not of what the fields hold is told as such. */
export function showVerdicts(store) {
  const place = byId("verdict");
  const badge = byId("badge");
  const remark = element("p", { class: "hint" });
  let doubt = null;

  const show = () => {
    const { observability: seen } = store.plan;
    const verdict = `${seen.observable ? "✓ Observable" : "✗ Not observable"}: rank ${seen.rank} of ${seen.state_dim}`;
    const text = doubt ? `${DOUBTS[doubt][0]}: ${verdict}` : verdict;
    // read out when it changes, and only then
    if (badge.textContent !== text) badge.textContent = text;
    badge.className = doubt ? "badge" : `badge ${seen.observable ? "good" : "bad"}`;
    remark.textContent = doubt ? DOUBTS[doubt][1] : "";
    place.classList.toggle("stale", doubt !== null);
    byId("workspace").classList.toggle("doubtful", doubt !== null);
  };
  const doubtFor = (why) => {
    doubt = why;
    if (store.plan) show();
  };
  store.addEventListener("plan", (event) => {
    place.replaceChildren(...verdictOf(store, event.detail.quick), remark);
    doubtFor(halfTyped() ? "typing" : null);
  });
  store.addEventListener("faults", (event) => doubtFor(event.detail.why));
  byId("editor").addEventListener("input", () => halfTyped() && doubtFor("typing"));
}

/** How to have the phases back that an edit lost, by where they came from. */
export function wayBack(origin) {
  return `Undo brings the ${origin === "refined" ? "refined plan" : "plan as it was"} back.`;
}

/** Whether a field holds what is no number yet, so that the scenario is without it. */
function halfTyped() {
  const fields = [...byId("editor").querySelectorAll("input[type=number]")];
  return fields.some((one) => one.validity.badInput || (one.value === "" && one.id.startsWith(NEEDED)));
}

function verdictOf({ plan, given, lost }, quick) {
  const { observability: seen, predicted_rms_m: predicted } = plan;
  return [
    table(plan, predicted, phases(plan, given, lost)),
    ...seen.unobservable.map(motionOf),
    ...plan.dropped_links.map((link) =>
      element("p", { class: "remark" }, element("strong", {}, `${link.a}–${link.b} dropped: `), link.reason),
    ),
    ...plan.notes.map((note) => element("p", { class: "remark" }, note)),
    element("p", { class: "hint" }, quick ? "Quick look while you move things …" : ""),
  ];
}

/** Where the phases of a plan come from, and how to have others back. */
function phases({ synchronisation: { method } }, given, lost) {
  const kept = method === "refined" || method === "given";
  return [kept ? ORIGINS[given?.origin] || ORIGINS[method] : "synchronised", lost ? `Found anew. ${wayBack(lost)}` : ""];
}

function table(plan, predicted, [origin, how]) {
  const { certificate } = plan.observability;
  const rows = [
    ["Phases", origin, how],
    ["Predicted RMS error", shown(predicted.overall, "m"), predicted.note],
    ["Worst vehicle", worst(predicted.vehicles), ""],
    ["Connectivity period", connectivity(plan), ""],
    ["Period", shown(plan.period_s, "s"), ""],
    ["Least separation", separation(plan), plan.separation.violations.length ? "nearer than asked for" : ""],
    ["Certificate", certificate.holds ? "holds" : "does not hold", certificate.reason],
  ];
  return element(
    "table",
    { class: "facts" },
    element(
      "tbody",
      {},
      ...rows.map(([name, value, remark]) =>
        element(
          "tr",
          {},
          element("th", { scope: "row" }, name),
          element("td", {}, value, remark ? element("span", { class: "hint block" }, remark) : null),
        ),
      ),
    ),
  );
}

function worst(vehicles) {
  const known = Object.entries(vehicles).filter(([, value]) => value !== null);
  if (!known.length) return "—";
  const [name, value] = known.reduce((a, b) => (b[1] > a[1] ? b : a));
  return `${name}, ${shown(value, "m")}`;
}

function connectivity(plan) {
  return plan.connectivity_period_s === null ? "never connected" : shown(plan.connectivity_period_s, "s");
}

function separation({ separation: least }) {
  return least.between ? `${shown(least.min_m, "m")}, ${least.between.join("–")}` : "—";
}

function motionOf(motion) {
  return element(
    "div",
    { class: "motion" },
    element("p", {}, element("strong", {}, "Not seen: "), motion.description),
    element("p", {}, element("strong", {}, "Cure: "), motion.cure),
  );
}
