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

/** The tabs of figures. */
export class Charts {
  #plot = byId("panel-plot");
  #text = byId("panel-text");
  #button = byId("show-figures");
  #figures = {};
  #store;
  #tabs;

  constructor(store) {
    this.#store = store;
    this.#tabs = tabs(byId("tabs"), TITLES, (name) => this.#draw(name));
    this.#button.addEventListener("click", () => this.open(byId("figures").hidden));
    store.on(["scenario", "opened"], () => this.#forget());
    store.on(["plan"], ({ figures, opened, again }) => {
      this.#take(figures);
      if (opened || again) this.#compare(store.plan, { show: opened ? "comparison" : "" });
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => attempt(() => this.#ask()));
  }

  /** The contact timeline, if it is on show: the animation moves a line along it. */
  get timeline() {
    return this.#tabs.current() === "timeline" && this.#plot.layout ? this.#plot : null;
  }

  /** Add figures of a stored plan or a job, by their addresses, if they are `wanted()` once here.
   * @param {Record<string, string>} addresses
   * @param {{show?: string, wanted?: () => boolean}} options */
  async add(addresses, { show = "", wanted = () => true } = {}) {
    const names = Object.keys(addresses);
    const answers = names.map((name) => patiently(() => askJson("GET", `${addresses[name]}?theme=${theme()}`)));
    const found = /** @type {any[]} */ (await Promise.allSettled(answers));
    if (!wanted()) return;
    // what a figure is of may have been deleted: the others are there
    this.#take(Object.fromEntries(names.map((name, k) => [name, found[k].value])));
    if (show in this.#figures) this.#tabs.choose(show);
  }

  /** Open the figures or close them; only open ones are drawn, and load what draws them. */
  open(flag = true) {
    const opens = flag && byId("figures").hidden;
    byId("figures").hidden = !flag;
    this.#button.setAttribute("aria-expanded", flag);
    Planner.figures = flag ? ASKED : [];
    if (!opens) return;
    if (this.#tabs.current()) this.#draw(this.#tabs.current());
    attempt(() => this.#ask());
  }

  /** Ask for the figures of the plan on show, in the colours of the theme. */
  async #ask() {
    const { plan, planId, document } = this.#store;
    if (!plan) return;
    const { figures } = await (planId ? Planner.stored(planId) : Planner.preview(document));
    if (this.#store.plan === plan) this.#store.judged(plan, figures, { quick: false });
    // what took its place meanwhile may have been asked for without figures
    else await this.#ask();
  }

  /** Add the figures of a refined plan beside what it was refined from. */
  async #compare({ id, parent_id: parentId }, { show }) {
    if (!parentId) return;
    const at = `v1/plans/${id}/figures`;
    const more = { comparison: `${at}/comparison`, refinement: `${at}/refinement` };
    await this.add(more, { show, wanted: () => this.#store.planId === id });
  }

  #take(figures) {
    for (const [name, figure] of Object.entries(figures)) if (figure) this.#figures[name] = figure;
    this.#offer();
    if (figures[this.#tabs.current()]) this.#draw(this.#tabs.current());
  }

  #forget() {
    for (const name of Object.keys(this.#figures)) if (!ASKED.includes(name)) delete this.#figures[name];
    this.#offer();
  }

  #offer() {
    this.#tabs.show(Object.keys(TITLES).filter((name) => name in this.#figures));
  }

  #draw(name) {
    const figure = this.#figures[name];
    if (!figure || byId("figures").hidden) return;
    byId("panel").setAttribute("aria-labelledby", `tab-${name}`);
    this.#text.textContent = plain(figure.layout.title?.subtitle?.text || "");
    this.#plot.setAttribute("aria-label", `${TITLES[name]}. ${this.#text.textContent}`);
    draw(this.#plot, figure);
  }
}

/** Text of a figure without Plotly's markup. */
function plain(text) {
  const parsed = new DOMParser().parseFromString(text.replaceAll("<br>", " "), "text/html");
  return parsed.body.textContent;
}
