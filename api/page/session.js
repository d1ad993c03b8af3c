// What the browser keeps: the scenario being edited, over a reload, that there was a visit, and in what positions are shown.

const STORED_KEY = "syncplan-edit";
const VISITED_KEY = "syncplan-visited";
const DEGREES_KEY = "syncplan-degrees";

/** Keep a store's scenario in the tab while no address names it.
 *
 * Kept are the state that was judged last and, where it is another, the scenario as it stands: one
 * with a fault can be opened as an edit of the other alone.
 */
export function keepOverReloads(store) {
  let judged = null;
  const keep = () => {
    if (!judged) return;
    const { state, planId } = store;
    const scenario = state.scenario === judged.scenario ? null : state.scenario;
    write(planId ? null : { state: judged, scenario });
  };
  store.on(["opened"], () => (judged = store.state));
  store.on(["plan"], (detail) => {
    if (detail.current) judged = store.state;
    keep();
  });
  addEventListener("pagehide", keep);
}

/** What was kept, `{ state, scenario }`, or null. */
export function kept() {
  return allowed(() => JSON.parse(sessionStorage.getItem(STORED_KEY) ?? "null"));
}

/** Forget what was kept. */
export function forget() {
  write(null);
}

function write(value) {
  allowed(() => (value ? sessionStorage.setItem(STORED_KEY, JSON.stringify(value)) : sessionStorage.removeItem(STORED_KEY)));
}

/** Whether nobody has done anything on the page in this browser yet. */
export function isFirstVisit() {
  return allowed(() => localStorage.getItem(VISITED_KEY) === null) ?? false;
}

/** Keep in mind that there was a visit. */
export function remember() {
  allowed(() => localStorage.setItem(VISITED_KEY, "yes"));
}

/** Whether positions were last shown in degrees. */
export function keptDegrees() {
  return allowed(() => localStorage.getItem(DEGREES_KEY) === "yes") ?? false;
}

/** Keep in mind whether positions are shown in degrees. */
export function keepDegrees(degrees) {
  allowed(() => localStorage.setItem(DEGREES_KEY, degrees ? "yes" : "no"));
}

/** What a use of the browser's storage returns; null where there is no room, or no leave. */
function allowed(use) {
  try {
    return use();
  } catch {
    return null;
  }
}
