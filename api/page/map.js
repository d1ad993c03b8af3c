// The formation drawn by Plotly, with handles over it that pointer and keyboard move.

import { draw, isNarrow, widen } from "./drawing.js";
import { byId, element, shown } from "./elements.js";
import { legendOf } from "./legend.js";
import { landmarksOf, round, vehiclesOf, withCenter, withLandmark } from "./scenario.js";
import { Sight } from "./sight.js";

const STEP = 0.01;
const LONG_STEP = 0.05;
/** By what share of the view the legend's room and a move may change it, and steps stay as they are. */
const SAME_VIEW = 0.3;
const TREMOR_PX = 4;
const SAME_M = 1e-6;

/** The map: draws what the service sends, and turns handles that move into edits. */
export class FormationMap {
  #store;
  #plot = byId("map-plot");
  #handles = byId("handles");
  #legend = byId("map-legend");
  #dragged = null;
  #held = null;
  /** Width of the view that steps by the arrow keys are a share of. */
  #stepped = 0;
  #formation = null;
  #sight = new Sight();
  #time = 0;

  constructor(store) {
    this.#store = store;
    this.#handles.before(this.#sight.drawing);
    store.addEventListener("plan", (event) => {
      this.#formation = event.detail.figures.formation || this.#formation;
      this.drawPlan();
    });
    for (const name of ["scenario", "opened", "selected"]) {
      store.addEventListener(name, () => this.#placeHandles());
    }
    store.addEventListener("faults", () => this.#reveal());
    document.addEventListener("keydown", (event) => event.key === "Escape" && this.#takeBack());
  }

  get plot() {
    return this.#plot;
  }

  /** Show what the chosen vehicle covers so many seconds after the start; null for nothing. */
  moment(time) {
    this.#time = time;
    this.#showSight();
  }

  #showSight() {
    const axes = this.#plot._fullLayout;
    if (!axes?.xaxis || !this.#store.scenario) return;
    const { selected, scenario, plan } = this.#store;
    const chosen = selected?.kind === "vehicle" && this.#time !== null ? vehiclesOf(scenario, plan)[selected.k] : null;
    this.#sight.show(chosen, plan, this.#time, axes);
    byId("sight-help").hidden = !chosen;
  }

  /** Draw the formation of the plan on show, as it is at time 0. */
  drawPlan() {
    return this.draw(this.#formation);
  }

  /** Draw a formation or one of its moments; the view stays while something is dragged. */
  async draw(figure) {
    if (!figure) return;
    const { layout } = figure;
    if (this.#held) {
      layout.xaxis.range = this.#held.x;
      layout.yaxis.range = this.#held.y;
    }
    const first = !this.#plot.data;
    const narrow = isNarrow(this.#plot);
    this.#legend.hidden = !narrow;
    if (narrow) this.#legend.querySelector("ul").replaceChildren(...legendOf(figure));
    await draw(this.#plot, figure, { filling: true });
    if (first) {
      for (const name of ["plotly_afterplot", "plotly_relayouting", "plotly_relayout"]) {
        this.#plot.on(name, () => this.#placeHandles());
      }
    }
    this.#plot.setAttribute("aria-label", `Map of the formation. ${figure.layout.title?.subtitle?.text || ""}`);
    this.#placeHandles();
  }

  #bodies() {
    const { scenario, plan } = this.#store;
    const vehicles = vehiclesOf(scenario, plan).map((one, k) => ({ ...one, kind: "vehicle", k }));
    const landmarks = landmarksOf(scenario).map((one, k) => ({ ...one, kind: "landmark", k }));
    return [...vehicles, ...landmarks];
  }

  #placeHandles() {
    const axes = this.#plot._fullLayout;
    if (!axes?.xaxis || !this.#store.scenario) return;
    this.#showSight();
    const bodies = this.#bodies();
    const made = [...this.#handles.children];
    made.slice(bodies.length).forEach((one) => one.remove());
    bodies.forEach((body, k) => {
      const handle = made[k] || this.#newHandle();
      const { selected } = this.#store;
      handle.body = body;
      const there = this.#isDrawn(body);
      handle.className = `handle ${body.kind}${there ? "" : " moved"}`;
      handle.setAttribute("aria-pressed", selected?.kind === body.kind && selected.k === body.k);
      handle.setAttribute("aria-label", labelOf(body));
      handle.title = body.name;
      handle.style.left = `${pixelOf(axes.xaxis, body.x)}px`;
      handle.style.top = `${pixelOf(axes.yaxis, body.y)}px`;
      const ring = handle.firstChild;
      ring.hidden = body.kind !== "vehicle" || (there && this.#dragged !== handle) || !isInView(axes, body);
      if (!ring.hidden) {
        const size = 2 * Math.abs(axes.xaxis.d2p(body.radius) - axes.xaxis.d2p(0));
        ring.style.width = ring.style.height = `${size}px`;
      }
    });
  }

  /** Whether the map shows a body where the scenario has it: not while an edit waits or is at fault. */
  #isDrawn(body) {
    const { plan } = this.#store;
    if (!plan) return false;
    const drawn = body.kind === "vehicle" ? plan.vehicles[body.k] : landmarksOf(plan.scenario)[body.k];
    if (!drawn) return false;
    const [x, y] = drawn.center_m || [drawn.x, drawn.y];
    const grown = (body.radius ?? 0) - (drawn.radius_m ?? 0);
    return Math.hypot(x - body.x, y - body.y, grown) <= SAME_M;
  }

  /** Widen the view to all that the scenario has: what is at fault is drawn by no plan. */
  #reveal() {
    const axes = this.#plot._fullLayout;
    if (this.#held || !axes?.xaxis || !this.#store.scenario) return;
    const bodies = this.#bodies();
    const spans = ["x", "y"].map((name) => {
      const ends = bodies.flatMap((one) => [one[name] - (one.radius ?? 0), one[name] + (one.radius ?? 0)]);
      const seen = axes[`${name}axis`].range;
      return { seen, all: [Math.min(...seen, ...ends), Math.max(...seen, ...ends)] };
    });
    if (spans.every(({ seen, all }) => all[0] === seen[0] && all[1] === seen[1])) return;
    widen(this.#plot, ...spans.map(({ all }) => all));
  }

  #newHandle() {
    const handle = element("button", { type: "button" }, element("span", { class: "ring", hidden: true }));
    handle.addEventListener("pointerdown", (event) => this.#grab(handle, event));
    handle.addEventListener("pointermove", (event) => this.#drag(handle, event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      handle.addEventListener(name, () => this.#drop(handle));
    }
    handle.addEventListener("keydown", (event) => this.#nudge(handle, event));
    handle.addEventListener("click", () => this.#store.select({ kind: handle.body.kind, k: handle.body.k }));
    this.#handles.append(handle);
    return handle;
  }

  #grab(handle, event) {
    if (event.button !== 0) return;
    handle.setPointerCapture(event.pointerId);
    this.#dragged = handle;
    const { xaxis, yaxis } = this.#plot._fullLayout;
    const at = [event.clientX, event.clientY];
    this.#held = { x: [...xaxis.range], y: [...yaxis.range], first: true, at };
    const box = handle.getBoundingClientRect();
    this.#held.grip = [event.clientX - (box.left + box.width / 2), event.clientY - (box.top + box.height / 2)];
  }

  #drag(handle, event) {
    if (this.#dragged !== handle) return;
    const { xaxis, yaxis } = this.#plot._fullLayout;
    const box = this.#plot.getBoundingClientRect();
    const [gripX, gripY] = this.#held.grip;
    const x = xaxis.p2d(event.clientX - gripX - box.left - xaxis._offset);
    const y = yaxis.p2d(event.clientY - gripY - box.top - yaxis._offset);
    const [startX, startY] = this.#held.at;
    // a click by an unsteady hand is none of a drag
    if (this.#held.first && Math.hypot(event.clientX - startX, event.clientY - startY) < TREMOR_PX) return;
    this.#move(handle.body, x, y, { live: true, step: this.#held.first });
    this.#held.first = false;
  }

  #drop(handle) {
    if (this.#dragged !== handle) return;
    const moved = !this.#held.first;
    this.#dragged = null;
    this.#held = null;
    const { kind, k } = handle.body;
    this.#store.select({ kind, k });
    if (moved) this.#store.edit(this.#store.scenario, { step: false });
  }

  /** End a drag as if it had not begun. */
  #takeBack() {
    if (!this.#dragged) return;
    const moved = !this.#held.first;
    this.#dragged = null;
    this.#held = null;
    if (moved) this.#store.undo();
  }

  #nudge(handle, event) {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const way = ways[event.key];
    if (!way) return;
    event.preventDefault();
    const { range } = this.#plot._fullLayout.xaxis;
    const width = Math.abs(range[1] - range[0]);
    if (Math.abs(width - this.#stepped) > SAME_VIEW * width) this.#stepped = width;
    const step = this.#stepped * (event.shiftKey ? LONG_STEP : STEP);
    const tidy = 10 ** Math.floor(Math.log10(step));
    const by = Math.round(step / tidy) * tidy;
    const { body } = handle;
    this.#move(body, body.x + way[0] * by, body.y + way[1] * by, { live: true, field: `${body.kind} ${body.k}` });
  }

  #move(body, x, y, how) {
    const change = body.kind === "vehicle" ? withCenter : withLandmark;
    const { xaxis, yaxis } = this.#plot._fullLayout;
    this.#store.edit(change(this.#store.scenario, body.k, tidied(x, xaxis), tidied(y, yaxis)), how);
  }
}

/** Where a coordinate lies over the map, in px; at the edge what lies beyond it. */
function pixelOf(axis, value) {
  return axis._offset + Math.min(Math.max(axis.d2p(value), 0), axis._length);
}

function isInView(axes, { x, y }) {
  const within = ({ range }, value) => value >= range[0] && value <= range[1];
  return within(axes.xaxis, x) && within(axes.yaxis, y);
}

function labelOf(body) {
  const where = `${shown(body.x)}, ${shown(body.y)} m`;
  return body.kind === "vehicle" ? `Circle of ${body.name}, centre at ${where}` : `Landmark ${body.name} at ${where}`;
}

/** A coordinate within the view, rounded to the size of a pixel. */
function tidied(value, { range, _length: length }) {
  const [low, high] = range;
  const tidy = 10 ** Math.floor(Math.log10((high - low) / length));
  const kept = Math.min(Math.max(Math.round(value / tidy), Math.ceil(low / tidy)), Math.floor(high / tidy));
  return round(kept * tidy);
}
