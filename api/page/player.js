// One period played on the map, with a line in the timeline; or a flown trial.

import { reshape } from "./drawing.js";
import { byId, element, shown } from "./elements.js";
import { eventsAt, momentOfFlight } from "./flown.js";

/** Real time in ms in which a period, or the turn of a flight, passes. */
const PERIOD_MS = 7000;
const STEPS = 600;

/** Plays a store's plan. */
export class Player {
  #store;
  #map;
  #charts;
  #button = byId("play");
  #slider = byId("moment");
  #played = byId("played");
  #happening = byId("happening");
  /** tracks of flown trials with their times, and what happens in all of them */
  #flights = { tracks: [], times: [], events: [], landmarks: [] };
  #frame = 0;
  #last = 0;

  constructor(store, map, charts) {
    this.#store = store;
    this.#map = map;
    this.#charts = charts;
    this.#slider.max = STEPS;
    this.#button.addEventListener("click", () => (this.#frame ? this.pause() : this.play()));
    this.#slider.addEventListener("input", () => this.#show());
    this.#played.addEventListener("change", () => this.#change());
    for (const one of [this.#button, this.#slider]) one.disabled = true;
    store.on(["scenario", "opened"], () => this.#reset());
    store.on(["plan"], () => this.#show());
  }

  /** Offer to play the flown trials of a report on the plan on show, beside the plan.
   * @param {any} report */
  offer({ series, events } = {}) {
    const tracks = series?.tracks ?? [];
    this.#flights = { tracks, times: series?.track_time_s ?? [], events: events ?? [], landmarks: series?.ground?.landmarks ?? [] };
    const options = tracks.map(({ trial }, k) => element("option", { value: k }, `Flight ${trial + 1}`));
    this.#played.replaceChildren(element("option", { value: "" }, "The plan"), ...options);
    for (const one of [this.#played, this.#happening]) one.hidden = !tracks.length;
  }

  pause() {
    cancelAnimationFrame(this.#frame);
    this.#frame = 0;
    this.#button.textContent = "Play";
    this.#button.setAttribute("aria-pressed", "false");
  }

  /** The track that is chosen; null for the plan itself. */
  get #track() {
    return this.#flights.tracks[this.#played.value || -1] ?? null;
  }

  /** The length in s of what is played. */
  get #length() {
    return this.#track ? this.#flights.times.at(-1) : this.#store.plan.period_s;
  }

  #change() {
    this.pause();
    this.#slider.value = 0;
    const moments = this.#track ? this.#flights.events.map(({ begin_s: time }) => Math.round((STEPS * time) / this.#length)) : [];
    byId("moments").replaceChildren(...moments.map((value) => element("option", { value })));
    this.#show();
  }

  #reset() {
    this.pause();
    this.offer();
    for (const one of [this.#button, this.#slider]) one.disabled = this.#store.scenario === null;
    this.#slider.value = 0;
    if (this.#store.plan) this.#show();
  }

  /** Play on and on, or `once` until the end. */
  play({ once = false } = {}) {
    if (!this.#store.plan) return;
    this.#button.textContent = "Pause";
    this.#button.setAttribute("aria-pressed", "true");
    this.#last = performance.now();
    const step = (now) => {
      const periods = this.#length / this.#store.plan.period_s;
      const on = (STEPS * (now - this.#last)) / (PERIOD_MS * periods);
      if (on >= 1) {
        this.#last = now;
        const moment = Number(this.#slider.value) + Math.round(on);
        this.#slider.value = moment % STEPS;
        this.#show();
        if (once && moment >= STEPS) {
          this.pause();
          return;
        }
      }
      this.#frame = requestAnimationFrame(step);
    };
    this.#frame = requestAnimationFrame(step);
  }

  /** Show the moment of the slider. */
  #show() {
    const { plan } = this.#store;
    if (!plan) return;
    const time = (this.#length * Number(this.#slider.value)) / STEPS;
    byId("moment-text").textContent = `${shown(time)} s`;
    this.#slider.setAttribute("aria-valuetext", `${shown(time)} seconds`);
    const happening = this.#track ? eventsAt(this.#flights.events, time) : [];
    const words = happening.map(({ what }) => what).join("; ");
    if (words !== this.#happening.textContent) this.#happening.textContent = words;
    if (this.#track) this.#map.flown(momentOfFlight(this.#track, this.#flights, plan.period_s, time, happening));
    else this.#map.moment(time);
    const timeline = this.#charts.timeline;
    if (timeline) {
      const others = (timeline.layout.shapes || []).filter((one) => one.name !== "moment");
      reshape(timeline, [...others, momentLine(time % plan.period_s)]);
    }
  }
}

function momentLine(time) {
  return { name: "moment", type: "line", xref: "x", yref: "paper", x0: time, x1: time, y0: 0, y1: 1, line: { width: 2, color: "#d55e00" } };
}
