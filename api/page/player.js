// One period played on the map, with the sightings of each moment and a line in the timeline; or a flown trial.

import { reshape, showFrame } from "./drawing.js";
import { byId, element, notice, shown } from "./elements.js";
import { flownAnimation } from "./flown_animation.js";
import { Planner, theme } from "./planner.js";
import { askJson } from "./service.js";

const FRAME_MS = 120;

/** Plays a store's plan. */
export class Player {
  #store;
  #map;
  #charts;
  #button = byId("play");
  #slider = byId("moment");
  #played = byId("played");
  /** tracks of flown trials and their times */
  #flights = { tracks: [], times: [] };
  #figure = null;
  #loading = null;
  #timer = 0;
  /** whether the map shows a moment, not the plan's own figure */
  #moving = false;

  constructor(store, map, charts) {
    this.#store = store;
    this.#map = map;
    this.#charts = charts;
    this.#button.addEventListener("click", () => (this.#timer ? this.#stop() : this.#play()));
    this.#slider.addEventListener("input", () => this.#seek());
    this.#played.addEventListener("change", () => this.#change());
    for (const name of ["scenario", "opened"]) store.addEventListener(name, () => this.#reset());
    store.addEventListener("plan", () => this.#renew());
    for (const one of [this.#button, this.#slider]) one.disabled = true;
  }

  /** Offer to play flown trials of the plan on show, beside the plan. */
  offer(tracks, series) {
    this.#flights = { tracks, times: series?.track_time_s ?? [] };
    const options = tracks.map(({ trial }, k) => element("option", { value: k }, `Flight ${trial + 1}`));
    this.#played.replaceChildren(element("option", { value: "" }, "The plan"), ...options);
    this.#played.hidden = !tracks.length;
  }

  /** The track that is chosen; null for the plan itself. */
  get #track() {
    return this.#flights.tracks[this.#played.value || -1] ?? null;
  }

  #change() {
    this.pause();
    this.#slider.value = 0;
    this.#renew();
    this.#track ? this.#seek() : this.#map.drawPlan();
    this.#say(0);
  }

  pause() {
    clearInterval(this.#timer);
    this.#timer = 0;
    this.#button.textContent = "Play";
    this.#button.setAttribute("aria-pressed", "false");
  }

  #stop() {
    this.pause();
    this.#show();
  }

  #reset() {
    this.pause();
    if (this.#moving) this.#map.drawPlan();
    this.#moving = false;
    this.#figure = this.#loading = null;
    this.offer([]);
    for (const one of [this.#button, this.#slider]) one.disabled = this.#store.scenario === null;
    this.#slider.value = 0;
    this.#say(0);
  }

  /** A plan that is judged puts its formation on the map: go on with the moments of that plan. */
  #renew() {
    this.#figure = this.#loading = null;
    this.#moving = false;
    if (this.#timer || Number(this.#slider.value) > 0) this.#seek();
  }

  async #play() {
    if (!(await this.#ready()) || this.#timer) return;
    this.#button.textContent = "Pause";
    this.#button.setAttribute("aria-pressed", "true");
    this.#timer = setInterval(() => {
      if (!this.#figure) return;
      this.#slider.value = (Number(this.#slider.value) + 1) % this.#figure.frames.length;
      this.#show();
    }, FRAME_MS);
  }

  async #seek() {
    if ((await this.#ready()) && this.#figure) this.#show();
  }

  /** Whether the animation of the plan on show is on the map; fetches it once. */
  #ready() {
    this.#loading ??= this.#load();
    return this.#loading;
  }

  async #load() {
    const { scenario, document, plan, planId } = this.#store;
    try {
      const found = planId
        ? await askJson("GET", `v1/plans/${planId}/figures/animation?theme=${theme()}`)
        : (await Planner.preview(document, { figures: ["animation"] })).figures.animation;
      if (this.#store.scenario !== scenario) return false;
      if (this.#store.plan !== plan) return this.#ready();
      this.#figure = this.#track ? flownAnimation(found, this.#track, this.#flights.times, plan.period_s) : found;
      this.#slider.max = this.#figure.frames.length - 1;
      return true;
    } catch (error) {
      notice(error.message, { fault: true });
      this.#loading = null;
      return false;
    }
  }

  /** Show the moment of the slider: while nothing plays, that of time 0 is the plan's own figure. */
  async #show() {
    if (!this.#figure) return;
    this.#announce();
    if (Number(this.#slider.value) === 0 && !this.#timer && !this.#track) {
      if (this.#moving) this.#map.drawPlan();
      this.#moving = false;
      return;
    }
    if (!this.#moving) {
      this.#moving = true;
      await this.#map.draw(this.#figure);
    }
    // meanwhile another plan may have come, or people have gone back to time 0
    if (this.#moving && this.#figure) showFrame(this.#map.plot, this.#figure.frames[Number(this.#slider.value)]);
  }

  #announce() {
    const { period_s: period } = this.#store.plan;
    const { frames, times } = this.#figure;
    const moment = Number(this.#slider.value);
    const time = times ? times[moment] : (period * moment) / frames.length;
    this.#say(time);
    const timeline = this.#charts.timeline;
    if (timeline) {
      const others = (timeline.layout.shapes || []).filter((one) => one.name !== "moment");
      reshape(timeline, [...others, momentLine(time % period)]);
    }
  }

  #say(time) {
    byId("moment-text").textContent = `${shown(time)} s`;
    // what a sensor covers is known of the plan
    this.#map.moment(this.#track ? null : time);
    this.#slider.setAttribute("aria-valuetext", `${shown(time)} seconds`);
  }
}

function momentLine(time) {
  return { name: "moment", type: "line", xref: "x", yref: "paper", x0: time, x1: time, y0: 0, y1: 1, line: { width: 2, color: "#d55e00" } };
}
