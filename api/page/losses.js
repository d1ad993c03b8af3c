// What if: the plan without each vehicle, sensor and landmark, as the service judges it; and without those
// that are switched off on the map.

import { attemptAt, button, byId, element, folded, notice, shown, table } from "./elements.js";
import { askJson } from "./service.js";

/** Losses that stand open; the others are folded. */
const MOST_OPEN = 12;

/** What stands before a vehicle's name where a sensor of it is lost, and what that is called. */
const SENSORS = { sensor: "sensor", compass: "compass", distance: "distance sensor" };

/** The panel of losses. `storePlan()` resolves with the identifier of the plan on show. */
export function offerLosses(store, storePlan) {
  const [fault, found, judges] = ["losses-fault", "losses-found", "judge-losses"].map(byId);
  judges.addEventListener("click", judge);
  const wordsOf = (error) => store.deleted(error) || error.message;
  const clear = () => {
    judges.disabled = store.scenario === null;
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
      const { losses } = await whatIf(`?${new URLSearchParams(off.map((name) => ["lose", name]))}`);
      store.judgedWithout(off, losses[0]);
    } catch (error) {
      store.judgedWithout(off, { fault: wordsOf(error) });
    }
  }

  async function judge() {
    const { scenario } = store;
    const current = () => store.scenario === scenario;
    judges.disabled = true;
    const task = async () => {
      const report = await whatIf("");
      if (!current()) return;
      found.replaceChildren(...outcomes(store, report));
      notice(headline(report));
    };
    await attemptAt(fault, task, (error) => (current() ? wordsOf(error) : ""));
    judges.disabled = store.scenario === null;
    if (document.activeElement === document.body) judges.focus();
  }

  async function whatIf(query) {
    return askJson("GET", `v1/plans/${await storePlan()}/what-if${query}`);
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

/** A button that switches a part off on the map, and on again: several may be off. In a list it shows the part's name. */
export function switchOf(store, part, attributes = { class: "small" }) {
  const pressed = button("", () => store.switchOff(switched(store.off, part)), { "data-part": part, ...attributes });
  label(pressed, store.off);
  return pressed;
}

function label(pressed, off) {
  const { part } = pressed.dataset;
  const deed = `Switch ${off.includes(part) ? "on" : "off"} ${lostOf([part])}`;
  const listed = pressed.classList.contains("plain");
  pressed.textContent = listed ? lostOf([part]) : deed;
  if (listed) for (const [name, value] of Object.entries({ title: deed, "aria-label": deed, "aria-pressed": off.includes(part) })) pressed.setAttribute(name, value);
}

/** The parts that are off once one was switched; a vehicle and a sensor of it take each other's place. */
export function switched(off, part) {
  if (off.includes(part)) return off.filter((one) => one !== part);
  const isOf = (one, vehicle) => Object.keys(SENSORS).some((sensor) => one === `${sensor}:${vehicle}`);
  return [...off.filter((one) => !isOf(one, part) && !isOf(part, one)), part];
}

/** Return how many losses end observability. */
function headline({ baseline, losses, critical }) {
  if (!baseline.observable) return `${losses.length} losses judged; the plan itself is not observable.`;
  return `${critical.length} of ${losses.length} losses end observability.`;
}

function outcomes(store, report) {
  const rest = report.losses.slice(MOST_OPEN);
  const lossesOf = (losses) => table(["Lost", "Rank", "Worst error", "Verdict"], losses.map((one) => row(store, one)));
  const first = [element("p", {}, headline(report)), lossesOf([report.baseline, ...report.losses.slice(0, MOST_OPEN)])];
  return rest.length ? [...first, folded(`${rest.length} less harmful losses`, lossesOf(rest))] : first;
}

function row(store, { lost, rank, state_dim: size, worst_predicted_rms_m: worst, unobservable, extended, verdict: { go } }) {
  const modes = [...unobservable, ...(extended?.undetermined ?? [])].map((mode) => mode.description).join("; ");
  const switches = lost.map((part) => switchOf(store, part, { class: "plain" }));
  const named = [lost.length ? switches : lostOf(lost), modes && element("span", { class: "hint block" }, modes)];
  return [named, `${rank} of ${size}`, shown(worst, "m"), go ? "GO" : "NO-GO"];
}
