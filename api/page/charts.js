// The figures beside the map: those of the plan come with it, others are asked for.

import { draw } from "./drawing.js";
import { attempt, byId } from "./elements.js";
import { askJson, patiently } from "./service.js";
import { Planner, theme } from "./planner.js";
import { FIGURES, PLAN_FIGURES } from "./tables.js";
import { tabs } from "./tabs.js";

/** The page draws the formation and plays its period on the map itself. */
const ON_MAP = ["formation", "animation"];
/** The figures that a plan on show comes with while figures are open. */
const ASKED = PLAN_FIGURES.filter((name) => !ON_MAP.includes(name));
const TITLES = Object.fromEntries(Object.entries(FIGURES).filter(([name]) => !ON_MAP.includes(name)));

/** Fill the tabs of figures; returns what adds some, what opens them, and the contact timeline if it is on show. */
export function offerCharts(store) {
  const plot = byId("panel-plot");
  const text = byId("panel-text");
  const part = byId("figures");
  const figures = {};
  const titles = tabs(byId("tabs"), TITLES, show);
  byId("show-figures").addEventListener("click", () => open(part.hidden));
  store.on(["scenario", "opened"], () => {
    for (const name of Object.keys(figures)) if (!ASKED.includes(name)) delete figures[name];
    offer();
  });
  store.on(["plan"], ({ figures: ofPlan, opened, again }) => {
    take(ofPlan);
    if (opened || again) compare(store.plan, { show: opened ? "comparison" : "" });
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => attempt(renew));
  return { add, open, timeline: () => (titles.current() === "timeline" && plot.layout ? plot : null) };

  /** Add figures of a stored plan or a job, by their addresses, if they are `wanted()` once here.
   * @param {Record<string, string>} addresses
   * @param {{show?: string, wanted?: () => boolean}} options */
  async function add(addresses, { show: first = "", wanted = () => true } = {}) {
    const names = Object.keys(addresses);
    const answers = names.map((name) => patiently(() => askJson("GET", `${addresses[name]}?theme=${theme()}`)));
    const found = /** @type {any[]} */ (await Promise.allSettled(answers));
    if (!wanted()) return;
    // what a figure is of may have been deleted: the others are there
    take(Object.fromEntries(names.map((name, k) => [name, found[k].value])));
    if (first in figures) titles.choose(first);
  }

  /** Open the figures or close them; only open ones are drawn, and load what draws them. */
  function open(flag = true) {
    const opens = flag && part.hidden;
    part.hidden = !flag;
    byId("show-figures").setAttribute("aria-expanded", flag);
    Planner.figures = flag ? ASKED : [];
    if (!opens) return;
    show(titles.current());
    attempt(renew);
  }

  /** Ask for the figures of the plan on show, in the colours of the theme. */
  async function renew() {
    const { plan, planId, document } = store;
    if (!plan) return;
    const found = await (planId ? Planner.stored(planId) : Planner.preview(document));
    if (store.plan === plan) store.judged(plan, found.figures, { quick: false });
    // what took its place meanwhile may have been asked for without figures
    else await renew();
  }

  /** Add the figures of a refined plan beside what it was refined from. */
  async function compare({ id, parent_id: parentId }, { show: first }) {
    if (!parentId) return;
    const at = `v1/plans/${id}/figures`;
    const more = { comparison: `${at}/comparison`, refinement: `${at}/refinement` };
    await add(more, { show: first, wanted: () => store.planId === id });
  }

  function take(found) {
    for (const [name, figure] of Object.entries(found)) if (figure) figures[name] = figure;
    offer();
    if (found[titles.current()]) show(titles.current());
  }

  function offer() {
    titles.show(Object.keys(TITLES).filter((name) => name in figures));
  }

  function show(name) {
    const figure = figures[name];
    if (!figure || part.hidden) return;
    byId("panel").setAttribute("aria-labelledby", `tab-${name}`);
    text.textContent = plain(figure.layout.title?.subtitle?.text || "");
    plot.setAttribute("aria-label", `${TITLES[name]}. ${text.textContent}`);
    draw(plot, figure);
  }
}

/** Text of a figure without Plotly's markup. */
function plain(text) {
  const parsed = new DOMParser().parseFromString(text.replaceAll("<br>", " "), "text/html");
  return parsed.body.textContent;
}
