// What the browser keeps: the scenario being edited, over a reload and for the next visit, that there was a visit, and in
// what positions are shown.

const STORED_KEY = "syncplan-edit";
const HISTORY_KEY = "syncplan-history";
const VISITED_KEY = "syncplan-visited";
const DEGREES_KEY = "syncplan-degrees";
/** Unsaved work has this key and when its tab was loaded. */
const UNSAVED_KEY = "syncplan-unsaved-";
/** so much of other tabs is kept */
const MOST_UNSAVED = 4;
/** the key of this tab's unsaved work, and of a lock that it holds as long as it is open */
const TAB = `${UNSAVED_KEY}${Date.now()}-${Math.random()}`;

/** Keep a store's scenario in the tab while no address names it, and for other visits while it is unsaved.
 *
 * Kept are the state that was judged last and, where it is another, the scenario as it stands: one
 * with a fault can be opened as an edit of the other alone.
 */
export function keepOverReloads(store) {
  let judged = null;
  const keep = () => {
    if (!judged) return;
    const { state, planId, unsaved } = store;
    const scenario = state.scenario === judged.scenario ? null : state.scenario;
    const work = { state: judged, scenario, tab: TAB, at: Date.now() };
    write("sessionStorage", STORED_KEY, planId ? null : work);
    write("localStorage", TAB, unsaved ? work : null);
    const others = unsavedKeys().filter((tab) => tab !== TAB);
    for (const tab of others.slice(MOST_UNSAVED)) discard({ tab });
  };
  store.on(["opened"], () => (judged = store.state));
  store.on(["plan"], (detail) => {
    if (detail.current) judged = store.state;
    // a whole one follows, and writing takes longer than a frame of a drag
    if (!detail.quick) keep();
  });
  store.on(["stored"], keep);
  addEventListener("pagehide", () => {
    keep();
    if (store.scenario) allowed(() => sessionStorage.setItem(HISTORY_KEY, JSON.stringify({ planId: store.planId, history: store.history })));
  });
  navigator.locks?.request(TAB, () => new Promise(() => {})).catch(() => {});
}

/** Let undo go on where a reload of the same work broke it off. */
export function recallHistory(store) {
  const { planId, history } = allowed(() => JSON.parse(sessionStorage.getItem(HISTORY_KEY) ?? "null")) ?? {};
  if (history?.length && planId === store.planId) store.recall(history);
}

/** Unsaved work of tabs that are closed, or may be where there are no locks, newest first: `{ state, scenario, tab, at }`. */
export async function unsavedWork() {
  const { held = [] } = (await navigator.locks?.query().catch(() => null)) ?? {};
  const closed = unsavedKeys().filter((tab) => tab !== TAB && !held.some(({ name }) => name === tab));
  const works = closed.map((tab) => allowed(() => ({ ...JSON.parse(localStorage.getItem(tab) ?? ""), tab })));
  return works.filter((work) => work?.state?.anchor?.scenario && work.state.scenario).sort((work, other) => other.at - work.at);
}

/** Forget unsaved work. */
export function discard({ tab }) {
  write("localStorage", tab, null);
}

/** The keys of unsaved work, the newest tab's first. */
function unsavedKeys() {
  const keys = allowed(() => Object.keys(localStorage)) ?? [];
  return keys.filter((key) => key.startsWith(UNSAVED_KEY)).sort().reverse();
}

/** What was kept, `{ state, scenario }`, or null. */
export function kept() {
  return allowed(() => JSON.parse(sessionStorage.getItem(STORED_KEY) ?? "null"));
}

/** Forget what was kept. */
export function forget() {
  write("sessionStorage", STORED_KEY, null);
}

function write(storage, key, value) {
  allowed(() => (value ? globalThis[storage].setItem(key, JSON.stringify(value)) : globalThis[storage].removeItem(key)));
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
