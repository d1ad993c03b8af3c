// What the plan comes to, in words.

import { byId, element, shown } from "./elements.js";
import { withValue } from "./scenario.js";

/** how far off the exact rule phases are put where that is the cure */
const DESYNC_RAD = 0.2;
const MOST_LISTED = 3;

/** What the verdict on show is not of, by why: what the badge begins with, and a remark. */
const DOUBTS = {
  fault: ["Before the fault", "This verdict is of the scenario before the fault."],
  away: ["Waiting for the service; before your edits", "This verdict is of the scenario before your edits, which wait for the service."],
  key: ["Waiting for a key; before your edits", "This verdict is of the scenario before your edits, which wait for a key."],
  typing: ["Before the unfinished field", "This verdict is of the scenario without the unfinished field."],
};

/** Fields that are never empty begin with this: those of one vehicle or landmark. */
const NEEDED = "field-chosen-";

const ORIGINS = {
  refined: "refined",
  file: "from a file",
  given: "as given",
};

/** Shows the verdict on a store's plan, and says when the fields hold something else. */
export function showVerdicts(store) {
  const place = byId("verdict");
  const badge = byId("badge");
  repeat(badge, byId("badge-again"));
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
    const cure = canDesync(store) ? () => desynchronise(store) : null;
    place.replaceChildren(...verdictOf(store, event.detail.quick, cure), remark);
    doubtFor(halfTyped() ? "typing" : null);
  });
  store.addEventListener("faults", (event) => doubtFor(event.detail.why));
  byId("editor").addEventListener("input", () => halfTyped() && doubtFor("typing"));
}

/** Keep what the verdict says in sight where the form is far below it, as on a phone. */
function repeat(badge, again) {
  const copy = () => {
    again.textContent = badge.textContent;
    again.className = badge.className;
  };
  new MutationObserver(copy).observe(badge, { attributes: true, characterData: true, childList: true, subtree: true });
  copy();
}

/** Whether phases are nearer to the rule than the cure would put them, and it would: of one sense it turns the team. */
function canDesync({ scenario, plan }) {
  if (plan.vehicles.every((one) => one.direction === plan.vehicles[0].direction)) return false;
  return [scenario.orbit.desync_rad ?? 0].flat().every((one) => Math.abs(one) < DESYNC_RAD);
}

function desynchronise(store) {
  store.edit(withValue(store.scenario, "orbit.desync_rad", DESYNC_RAD));
  // the button goes with the motion that it cures
  const badge = byId("badge");
  badge.tabIndex = -1;
  badge.focus();
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

function verdictOf({ plan, given, lost }, quick, cure) {
  const { observability: seen, predicted_rms_m: predicted } = plan;
  return [
    ...tooNear(plan.separation),
    table(plan, predicted, phases(plan, given, lost)),
    ...seen.unobservable.map((motion) => motionOf(motion, cure)),
    ...plan.dropped_links.map((link) =>
      element("p", { class: "remark" }, element("strong", {}, `${link.a}–${link.b} dropped: `), link.reason),
    ),
    ...plan.notes.map((note) => element("p", { class: "remark" }, note)),
    element("p", { class: "hint" }, quick ? "Quick preview while you edit …" : ""),
  ];
}

/** Where the phases of a plan come from, and how to have others back. */
function phases({ synchronisation: { method } }, given, lost) {
  const kept = method === "refined" || method === "given";
  return [kept ? ORIGINS[given?.origin] || ORIGINS[method] : "synchronised", lost ? `Computed anew. ${wayBack(lost)}` : ""];
}

function table(plan, predicted, [origin, how]) {
  const { certificate } = plan.observability;
  const rows = [
    ["Phases", origin, how],
    ["Predicted RMS error", shown(predicted.overall, "m"), predicted.note],
    ["Worst vehicle", worst(predicted.vehicles), ""],
    ["Connectivity period", connectivity(plan), ""],
    ["Period", shown(plan.period_s, "s"), ""],
    ["Least separation", separation(plan), plan.separation.violations.length ? "closer than required" : ""],
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

/** A line of its own where vehicles come closer than required: however observable, that is no plan to fly. */
function tooNear({ violations, required_m: required }) {
  if (!violations.length) return [];
  const listed = violations.slice(0, MOST_LISTED).map((one) => `${one.between.join("–")} to ${shown(one.min_m, "m")}`);
  const more = violations.length > MOST_LISTED ? ` and ${violations.length - MOST_LISTED} more` : "";
  const text = `✗ Closer than the required ${shown(required, "m")}: ${listed.join(", ")}${more}`;
  return [element("p", { class: "badge bad", id: "too-near" }, text)];
}

function motionOf(motion, cure) {
  const cured = cure && motion.cure.includes("desync_rad");
  return element(
    "div",
    { class: "motion" },
    element("p", {}, element("strong", {}, "Unobservable: "), motion.description),
    element("p", {}, element("strong", {}, "Cure: "), motion.cure),
    cured ? element("button", { type: "button", onclick: cure }, `Desynchronise by ${DESYNC_RAD}`) : null,
  );
}
