// What if: the plan without each vehicle, sensor and landmark, as the service judges it; and without those
// that are switched off on the map.

import { byId, element, notice, shown } from "./elements.js";
import { askJson } from "./service.js";

/** Losses that stand open; the others are folded. */
const MOST_OPEN = 12;

/** What stands before a vehicle's name where a sensor of it is lost, and what that is called. */
const SENSORS = { sensor: "sensor", compass: "compass", distance: "distance sensor" };

/** The panel of losses. `storePlan()` resolves with the identifier of the plan on show. */
export function offerLosses(store, storePlan) {
  const fault = element("p", { class: "fault", role: "alert", id: "losses-fault" });
  const found = element("div", { role: "status", id: "losses-found" });
  const button = element("button", { type: "button", id: "judge-losses", onclick: judge }, "Judge every loss");
  byId("losses").append(
    element("p", { class: "hint" }, "The plan without each vehicle, sensor or landmark, orbits unchanged. Errors are predicted from the initial sigmas on; where something is not observable they keep growing."),
    button,
    fault,
    found,
  );
  const clear = () => {
    button.disabled = store.scenario === null;
    fault.textContent = "";
    found.replaceChildren();
  };
  store.on(["opened", "scenario"], clear);
  store.on(["off"], () => {
    for (const one of document.querySelectorAll("[data-part]")) label(one, store.off);
    if (store.off.length && !store.without) judgeWithout(store.off);
  });
  clear();

  async function judgeWithout(off) {
    try {
      const lose = new URLSearchParams(off.map((name) => ["lose", name]));
      const { losses } = await askJson("GET", `v1/plans/${await storePlan()}/what-if?${lose}`);
      store.judgedWithout(off, losses[0]);
    } catch (error) {
      store.judgedWithout(off, { fault: store.deleted(error) || error.message });
    }
  }

  async function judge() {
    const { scenario } = store;
    fault.textContent = "";
    button.disabled = true;
    try {
      const report = await askJson("GET", `v1/plans/${await storePlan()}/what-if`);
      if (store.scenario === scenario) {
        found.replaceChildren(...outcomes(store, report));
        notice(headline(report));
      }
    } catch (error) {
      if (store.scenario === scenario) fault.textContent = store.deleted(error) || error.message;
    } finally {
      button.disabled = store.scenario === null;
      if (document.activeElement === document.body) button.focus();
    }
  }
}

/** Return what is lost as a sentence has it. */
export function lostOf(names) {
  const words = names.map((name) => {
    const [before, ...vehicle] = name.split(":");
    return vehicle.length && before in SENSORS ? `${SENSORS[before]} of ${vehicle.join(":")}` : name;
  });
  return new Intl.ListFormat("en").format(words) || "nothing";
}

/** A button that switches a part off on the map, and on again: several may be off. */
export function switchOf(store, part) {
  const button = element("button", { type: "button", class: "small", "data-part": part, onclick: () => store.switchOff(switched(store.off, part)) });
  label(button, store.off);
  return button;
}

function label(button, off) {
  const { part } = button.dataset;
  button.textContent = `Switch ${off.includes(part) ? "on" : "off"} ${lostOf([part])}`;
}

/** The parts that are off once one was switched; a vehicle and a sensor of it take each other's place. */
export function switched(off, part) {
  if (off.includes(part)) return off.filter((one) => one !== part);
  const isOf = (one, vehicle) => Object.keys(SENSORS).some((sensor) => one === `${sensor}:${vehicle}`);
  return [...off.filter((one) => !isOf(one, part) && !isOf(part, one)), part];
}

/** Return how many losses end observability. */
export function headline({ baseline, losses, critical }) {
  if (!baseline.observable) return `${losses.length} losses judged; the plan itself is not observable.`;
  return `${critical.length} of ${losses.length} losses end observability.`;
}

function outcomes(store, report) {
  const rest = report.losses.slice(MOST_OPEN);
  return [
    element("p", {}, headline(report)),
    table(store, [report.baseline, ...report.losses.slice(0, MOST_OPEN)]),
    rest.length ? element("details", {}, element("summary", {}, `${rest.length} less harmful losses`), table(store, rest)) : "",
  ];
}

function table(store, losses) {
  const heads = ["Lost", "Rank", "Worst error", "Verdict"];
  return element(
    "table",
    { class: "losses" },
    element("thead", {}, element("tr", {}, ...heads.map((head) => element("th", { scope: "col" }, head)))),
    element("tbody", {}, ...losses.map((one) => row(store, one))),
  );
}

function row(store, { lost, rank, state_dim: size, worst_predicted_rms_m: worst, unobservable, extended, verdict: { go } }) {
  const lostModes = [...unobservable, ...(extended?.undetermined ?? [])].map((mode) => mode.description).join("; ");
  return element(
    "tr",
    {},
    element(
      "th",
      { scope: "row" },
      lostOf(lost),
      lostModes ? element("span", { class: "hint block" }, lostModes) : null,
      ...lost.map((part) => element("span", { class: "block" }, switchOf(store, part))),
    ),
    element("td", {}, `${rank} of ${size}`),
    element("td", {}, shown(worst, "m")),
    element("td", {}, go ? "GO" : "NO-GO"),
  );
}
