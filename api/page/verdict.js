// What the plan comes to, in words.

import { button, byId, degreesBeside, element, renew, shown } from "./elements.js";
import { lostOf } from "./losses.js";
import { withoutLink, withValue } from "./scenario.js";
import { bodiesNamed } from "./selection.js";
import { explained } from "./terms.js";

/** What each level of a finding begins with. */
export const LEVELS = { stop: "Stop: ", warning: "Warning: ", note: "Note: " };

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
  hand: "set by hand",
};

/** The predicted errors of a quick plan. */
const FOLLOWING = { overall: null, vehicles: {}, note: "follows when you pause" };

/** Findings that only say what a quick plan leaves out: the last line says it once. */
const LEFT_OUT = ["bound-missing", "single-point-of-failure"];

/** Shows the verdict on a store's plan, and says when the fields hold something else. */
export function showVerdicts(store) {
  const place = byId("verdict");
  const findings = byId("findings");
  const badge = byId("badge");
  const facts = element("tbody");
  const following = element("p", { class: "hint" });
  const remark = element("p", { class: "hint" });
  let doubt = null;
  let quick = false;
  place.replaceChildren(element("table", { class: "facts" }, facts), following, remark);

  const show = () => {
    const { plan, off, without } = store;
    const whole = `${headOf(plan.verdict)}: ${sentenceOf(plan, quick)}`;
    const { go, basis } = (off.length ? without : plan)?.verdict ?? {};
    const warnings = plan.verdict.findings.filter(({ level }) => level === "warning").length;
    const warned = warnings ? [warnings === 1 ? ", 1 warning" : `, ${warnings} warnings`] : [];
    const verdict = off.length
      ? [element("strong", {}, remainderOf(off, without)), element("span", { class: "block" }, `With all switched on: ${whole}`, ...warned)]
      : [element("strong", {}, whole), element("span", { class: "block" }, ...explained(rankOf(plan)), ...warned)];
    byId("all-on").hidden = !off.length;
    const parts = doubt ? [element("span", { class: "block" }, `${DOUBTS[doubt][0]}:`), ...verdict] : verdict;
    // read out when it changes, and only then
    renew(badge, parts.flatMap((part, k) => (k ? [document.createTextNode(" "), part] : [part])));
    badge.className = doubt || go === undefined ? "badge" : `badge ${go ? `good ${warnings ? "warned " : ""}${basis?.kind ?? "paper"}` : "bad"}`;
    remark.textContent = doubt ? DOUBTS[doubt][1] : "";
    place.classList.toggle("stale", doubt !== null);
    byId("workspace").classList.toggle("doubtful", doubt !== null);
  };
  const doubtFor = (why) => {
    doubt = why;
    if (store.plan) show();
  };
  store.on(["plan"], (detail) => {
    quick = detail.quick;
    renew(findings, findingsOf(store, quick));
    renew(facts, rowsOf(store, quick));
    following.textContent = quick ? "Quick preview while you edit: flights, predicted errors, the connectivity period and single points of failure follow." : "";
    doubtFor(halfTyped() ? "typing" : null);
  });
  store.on(["faults"], ({ why, faults }) => {
    if (why === "fault" && faults.length) findings.replaceChildren(...faults.map((fault) => faultOf(store, fault)));
    doubtFor(why);
  });
  store.on(["off"], () => store.plan && show());
  byId("all-on").addEventListener("click", () => {
    store.switchOff([]);
    focusBadge();
  });
  byId("editor").addEventListener("input", () => halfTyped() && doubtFor("typing"));
}

/** GO with its basis, or NO-GO. A verdict of an early version states no basis: it rests on paper. */
function headOf({ go, basis, findings }) {
  if (!go) return "✗ NO-GO";
  const head = findings?.some(({ level }) => level === "warning") ? "⚠\uFE0E GO" : "✓ GO";
  if (basis?.kind !== "flown") return `${head} on paper`;
  return `${head} in ${basis.flights} simulated flight${basis.flights === 1 ? "" : "s"}`;
}

/** What the plan comes to without what is switched off: its verdict, rank, and what it can't detect then. */
function remainderOf(off, without) {
  const head = `Without ${lostOf(off)}: `;
  if (!without) return `${head}being judged …`;
  if (without.fault) return `${head}no verdict, as ${without.fault}`;
  const { rank, state_dim: size, worst_predicted_rms_m: worst, unobservable } = without;
  const lost = unobservable.map((one) => one.description).join("; ");
  return `${head}${headOf(without.verdict)}, rank ${rank} of ${size}, ${lost ? `undetectable: ${lost}` : `worst error ${shown(worst, "m")}`}`;
}

/** What a plan comes to: how well all know where they are, or why they do not. */
function sentenceOf(plan, quick) {
  const { observability: seen, verdict: { go, findings } } = plan;
  const count = plan.vehicles.length;
  const team = count === 1 ? "1 vehicle knows where it is" : `${count} vehicles know where they are`;
  if (go) {
    const known = Object.values(plan.predicted_rms_m.vehicles).filter((one) => one !== null);
    return quick || !known.length ? team : `${team} to ${shown(Math.max(...known), "m")} (worst RMS, predicted)`;
  }
  if (!seen.observable) return "not every position and heading can be known";
  const stops = findings.filter((one) => one.level === "stop");
  return stops.length === 1 ? "one reason not to fly" : `${stops.length} reasons not to fly`;
}

function rankOf({ observability: { observable, rank, state_dim: size } }) {
  return `${observable ? "Observable" : "Not observable"}: rank ${rank} of ${size}`;
}

/** Make the changes of the scenario that cure a finding. */
function cure(store, change) {
  mend(store, Object.entries(change).reduce((scenario, [key, value]) => withValue(scenario, key, value), store.scenario));
}

function mend(store, scenario) {
  store.edit(scenario);
  // the button goes with the finding that it cures
  focusBadge();
}

function focusBadge() {
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

/** The findings, reasons not to fly first, below what an edit did to phases that were given. */
function findingsOf(store, quick) {
  const { plan: { verdict: { findings } }, lost } = store;
  const counted = findings.filter((one) => !(quick && LEFT_OUT.includes(one.code)));
  const order = Object.keys(LEVELS);
  const sorted = [...counted].sort((one, other) => order.indexOf(one.level) - order.indexOf(other.level));
  const all = [lost && element("p", { class: "finding warning" }, `Phases of all vehicles are computed anew since the edit. ${wayBack(lost)}`), ...sorted.map((finding) => findingOf(store, finding))].filter(Boolean);
  return all.length ? all : [element("p", { class: "hint" }, "No findings.")];
}

/** Where the phases of a plan come from, and how to have others back. @returns {[string, string]} */
function phases({ synchronisation: { method } }, given, lost) {
  const kept = method === "refined" || method === "given";
  return [kept ? ORIGINS[given?.origin] || ORIGINS[method] : "synchronised", lost ? `Computed anew. ${wayBack(lost)}` : ""];
}

/** Rows of what is known of a plan. */
function rowsOf({ plan, given, lost }, quick) {
  const [origin, how] = phases(plan, given, lost);
  const { certificate } = plan.observability;
  const predicted = quick ? FOLLOWING : plan.predicted_rms_m;
  const rows = [
    ["Phases", origin, how],
    ["Worst error", worst(predicted.vehicles), "of the worst vehicle: the figure of the verdict"],
    ["Predicted RMS error", shown(predicted.overall, "m"), predicted.note || "of all vehicles together"],
    ...flown(plan),
    // errors that the filter does not estimate make it worse than its own prediction
    ...(plan.expected_rms_m ? [["Expected RMS error", shown(plan.expected_rms_m.overall, "m"), plan.expected_rms_m.note || "with what the filter does not estimate"]] : []),
    ...determined(plan.observability.states ?? []),
    ...errorsOf(plan.predicted_errors ?? []),
    ["Connectivity period", quick ? "—" : connectivity(plan), ""],
    ["Period", shown(plan.period_s, "s"), ""],
    ["Least separation", separation(plan), ruleOf(plan.separation)],
    ["Certificate", certificate.holds ? "holds" : "does not hold", certificate.reason],
  ];
  const row = (/** @type {any[]} */ [name, value, remark]) =>
    element("tr", {}, element("th", { scope: "row" }, explained(name)), element("td", {}, value, remark && element("span", { class: "hint block" }, remark)));
  return rows.map(row);
}

/** The error of the estimates in the flights that the verdict rests on. */
function flown({ flight }) {
  if (!flight || flight.rms_m === undefined) return [];
  const [low, high] = flight.rms_interval_m ?? [];
  const interval = low === undefined ? "" : ` (${shown(low)} to ${shown(high, "m")}, 95 %)`;
  return [["Flown RMS error", `${shown(flight.rms_m, "m")}${interval}`, `${flight.trials} flights, filter ${flight.filter}`]];
}

function determined(states) {
  if (!states.length) return [];
  const lacking = states.filter((one) => !one.determined).map((one) => one.state);
  const known = states.filter((one) => one.determined).map((one) => one.state);
  return [["Determined states", known.join(", ") || "none", lacking.length ? `not determined: ${lacking.join(", ")}` : ""]];
}

/** The predicted error of each kind of state, the worst vehicle's where there are many. */
function errorsOf(predicted) {
  const kinds = Map.groupBy(predicted, (one) => one.state.replace(/ of .*$/, ""));
  return [...kinds].map(([kind, all]) => {
    const [least, most] = [Math.min, Math.max].map((of) => of(...all.map((one) => one.predicted_rms)));
    const { unit } = all[0];
    const range = shown(least) === shown(most) ? shown(most, unit) : `${shown(least)} to ${shown(most, unit)}`;
    return [`Predicted error, ${kind}`, `${range}${degreesBeside(most, unit)}`, kind.startsWith("wind ") ? "for circles flown in still air" : ""];
  });
}

function worst(vehicles) {
  const known = Object.entries(vehicles).filter(([, value]) => value !== null);
  if (!known.length) return "—";
  const [name, value] = known.reduce((a, b) => (b[1] > a[1] ? b : a));
  return `${name}, ${shown(value, "m")}`;
}

function connectivity(plan) {
  if (plan.connectivity_period_s !== null) return shown(plan.connectivity_period_s, "s");
  // windows of up to two periods are searched, and none longer than the run
  return plan.scenario.duration_s < 2 * plan.period_s ? "none within the run" : "never connected";
}

/** The rule on separations that is in force. */
function ruleOf({ required_m: required, violations }) {
  const rule = required ? `at least ${shown(required, "m")} required` : "no least separation is stated: nearer than a tenth of the mean radius counts as too near";
  return violations.length ? `closer than required; ${rule}` : rule;
}

function separation({ separation: least }) {
  return least.between ? `${shown(least.min_m, "m")}, ${least.between.join("–")}` : "—";
}

/** One finding: its sentence, which leads to the places concerned, its cure, and a button where the cure is a change of the
 * scenario. */
function findingOf(store, { code, level, message, subjects, cure: remedy }) {
  const change = remedy?.change ?? {};
  const able = Object.keys(change).length > 0;
  return element(
    "div",
    { class: `finding ${level}`, "data-code": code },
    subjects?.length
      ? button([element("strong", {}, LEVELS[level]), message], () => store.selectAll(bodiesNamed(store.scenario, subjects), { reveal: true }), { class: "plain", title: "Show on the map" })
      : element("p", {}, element("strong", {}, LEVELS[level]), message),
    remedy && element("p", {}, element("strong", {}, "Cure: "), remedy.text),
    able && button(labelOf(change), () => cure(store, change)),
  );
}

/** One fault of the scenario, with a button where it is a link that can be taken out. */
function faultOf(store, { path, message }) {
  const [, k] = path.match(/^formation\.links\[(\d+)\]/) ?? [];
  const link = k && store.scenario.formation.links?.[k]?.join("–");
  return element(
    "div",
    { class: "finding stop" },
    element("p", {}, element("strong", {}, LEVELS.stop), message),
    link && button(`Remove the link ${link}`, () => mend(store, withoutLink(store.scenario, Number(k)))),
  );
}

function labelOf(change) {
  const [[key, value], ...others] = Object.entries(change);
  if (key === "orbit.desync_rad" && !others.length) return `Desynchronise by ${value}`;
  return `Set ${Object.entries(change).map(([name, to]) => `${name} to ${to}`).join(", ")}`;
}
