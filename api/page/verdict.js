// What the plan comes to, in words.

import { byId, element, shown } from "./elements.js";

/** Shows the verdict on a store's plan. */
export function showVerdicts(store) {
  const place = byId("verdict");
  const badge = byId("badge");
  store.addEventListener("plan", (event) => {
    const { observability: seen } = store.plan;
    const text = `${seen.observable ? "✓ Observable" : "✗ Not observable"}: rank ${seen.rank} of ${seen.state_dim}`;
    // read out when it changes, and only then
    if (badge.textContent !== text) badge.textContent = text;
    badge.className = `badge ${seen.observable ? "good" : "bad"}`;
    place.replaceChildren(...verdictOf(store.plan, event.detail.quick));
    place.classList.remove("stale");
  });
  store.addEventListener("faults", () => {
    if (!store.plan || place.classList.contains("stale")) return;
    place.classList.add("stale");
    place.append(element("p", { class: "hint" }, "Of the scenario before the fault."));
  });
}

function verdictOf(plan, quick) {
  const { observability: seen, predicted_rms_m: predicted } = plan;
  return [
    table(plan, predicted),
    ...seen.unobservable.map(motionOf),
    ...plan.dropped_links.map((link) =>
      element("p", { class: "remark" }, element("strong", {}, `${link.a}–${link.b} dropped: `), link.reason),
    ),
    ...plan.notes.map((note) => element("p", { class: "remark" }, note)),
    element("p", { class: "hint" }, quick ? "Quick look while you move things …" : ""),
  ];
}

function table(plan, predicted) {
  const { certificate } = plan.observability;
  const rows = [
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
