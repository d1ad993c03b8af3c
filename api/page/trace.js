// The worst predicted error against a number that is being changed, charted below its field.

import { element, shown } from "./elements.js";
import { rounded, sameOrbits, sameScenario } from "./scenario.js";
import { stepOf } from "./scrubbing.js";
import { Store } from "./store.js";

/** So long in ms further values are asked for. */
const PATIENCE_MS = 2000;
const SHARES = [-1 / 3, 1 / 3, -2 / 3, 2 / 3, -1, 1];
const [WIDTH, HEIGHT, EDGE] = [320, 56, 8];

/** Chart what the field edited last does to a store's plans, until something else is edited.
 *
 * Each point is a whole plan of the service; once the number rests, `preview(document, { signal })` makes some more.
 */
export function traceErrors(store, preview) {
  /** the last whole plan @type {{scenario: any, worst: number | null} | null} */
  let judged = null;
  /** the field, its points by value, and the chart @type {any} */
  let traced = null;
  let asking = new AbortController();

  store.on(["opened"], () => follow(null));
  store.on(["scenario"], ({ field }) => {
    asking.abort();
    if (traced?.field !== field) follow(field);
    show();
  });
  store.on(["plan"], ({ quick, flown, current }) => {
    if (quick || flown || !current) return;
    judged = { scenario: store.scenario, worst: worstOf(store.plan) };
    if (!traced) return;
    traced.points.set(traced.field.read(store.scenario), judged.worst);
    show();
    askAround();
  });

  function follow(field) {
    asking.abort();
    traced?.chart.remove();
    const may = field?.read && !field.kind && !field.steady;
    traced = may ? { field, points: new Map(), chart: element("div", { class: "trace" }) } : null;
    if (!may || !judged) return;
    const { read, change } = field;
    const before = read(judged.scenario);
    // the plan before the edit is one of them, if it differs in nothing else
    if (typeof before === "number" && sameScenario(change(judged.scenario, read(store.scenario)), store.scenario)) traced.points.set(before, judged.worst);
  }

  function show() {
    if (!traced) return;
    const { field, points, chart } = traced;
    const known = [...points.values()].filter((one) => one !== null);
    const value = field.read(store.scenario);
    if (known.length < 2 || typeof value !== "number") return;
    chart.replaceChildren(...chartOf(points, value, field.unit));
    if (!chart.isConnected) field.input.closest(".field").append(chart);
  }

  /** Add points around the value, one at a time, where no value can be refused. */
  async function askAround() {
    const { field, points } = traced;
    const { state } = store;
    const value = field.read(state.scenario);
    asking = new AbortController();
    const { signal } = asking;
    const until = performance.now() + PATIENCE_MS;
    // times have to fit each other, and a team out of its pattern may take long to synchronise
    if (typeof value !== "number" || field.unit === "s" || field.path.includes("[")) return;
    for (const other of around(value, points, field)) {
      const edited = new Store();
      edited.reopen(state, null);
      edited.edit(field.change(state.scenario, other));
      const mayBeRefused = state.scenario.formation.links && !sameOrbits(edited.scenario, state.scenario);
      if (mayBeRefused || performance.now() > until || !field.input.isConnected) return;
      try {
        const { plan } = await preview(edited.document, { figures: [], signal });
        if (signal.aborted) return;
        points.set(other, worstOf(plan));
        show();
      } catch {
        // there are fewer points then
        return;
      }
    }
  }
}

/** Return the predicted error of a plan's worst vehicle, null where it is not known of all. */
export function worstOf({ predicted_rms_m: { vehicles } }) {
  const errors = Object.values(vehicles);
  return errors.length && !errors.includes(null) ? Math.max(...errors) : null;
}

/** Return values around one, nearest first, but those at limits and near points that there are. */
export function around(value, points, { min = -Infinity, max = Infinity, unit = "" }) {
  const far = [...points.keys()].map((one) => Math.abs(one - value));
  const span = Math.max(...far, 0.3 * Math.abs(value), 3 * stepOf(value, unit));
  const near = (one) => [...points.keys()].some((other) => Math.abs(other - one) < span / 8);
  return SHARES.map((share) => rounded(value + share * span, 3)).filter((one) => one > min && one <= max && !near(one));
}

/** Return a sentence of the error at a value. */
export function errorAt(value, worst, unit = "") {
  const at = unit ? shown(value, unit) : shown(value);
  return worst === null || worst === undefined ? `no error known at ${at}` : `${shown(worst, "m")} at ${at}`;
}

/** A chart of errors by value, with the present value marked, and what it shows in words. */
function chartOf(points, value, unit) {
  const sorted = [...points].sort(([one], [other]) => one - other);
  const known = sorted.filter(([, worst]) => worst !== null);
  const [x, y] = [scaleOf([value, ...points.keys()], [EDGE, WIDTH - EDGE]), scaleOf(known.map(([, worst]) => worst), [HEIGHT - EDGE, EDGE])];
  const now = points.get(value) ?? null;
  const marks = known.map(([at, worst]) => element("svg:circle", { cx: x(at), cy: y(worst), r: 2.5 }));
  const [first, last] = [sorted[0], sorted[sorted.length - 1]].map(([at, worst]) => element("span", {}, errorAt(at, worst, unit)));
  const words = `Worst predicted error ${sorted.map(([at, worst]) => errorAt(at, worst, unit)).join("; ")}`;
  return [
    element("p", {}, "Worst predicted error: ", element("strong", {}, errorAt(value, now, unit))),
    element(
      "svg:svg",
      { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": words },
      element("svg:line", { x1: x(value), x2: x(value), y1: 0, y2: HEIGHT }),
      element("svg:polyline", { points: known.map(([at, worst]) => `${x(at)},${y(worst)}`).join(" ") }),
      marks,
      now !== null && element("svg:circle", { class: "now", cx: x(value), cy: y(now), r: 5 }),
    ),
    element("p", { class: "ends" }, first, last),
  ];
}

/** The scale from the range of some numbers to two ends; the middle where all are one. */
function scaleOf(numbers, [from, to]) {
  const [least, most] = [Math.min(...numbers), Math.max(...numbers)];
  return (one) => Number((most > least ? from + ((to - from) * (one - least)) / (most - least) : (from + to) / 2).toFixed(1));
}
