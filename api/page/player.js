// One period played on the map, with a line in the timeline; or a flown trial.

import { reshape } from "./drawing.js";
import { byId, element, options, shown } from "./elements.js";
import { eventsAt, momentOfFlight } from "./flown.js";

/** Real time in ms in which a period, or the turn of a flight, passes. */
const PERIOD_MS = 7000;
const STEPS = 600;
/** Into how many periods a run without a plan is divided. */
const RUNS = 4;

/** Let a store's plan be played on a map; returns what plays it, and what offers the flown trials of a report beside it. */
export function offerPlayer(store, map, charts) {
  const button = byId("play");
  const slider = byId("moment");
  const played = byId("played");
  const happening = byId("happening");
  /** tracks of flown trials with their times, and what happens in all of them */
  let flights = { tracks: [], times: [], events: [], landmarks: [] };
  /** the frame that is waited for while it plays */
  let frame = 0;
  /** whether they are played without the plan */
  let alone = false;

  slider.max = STEPS;
  button.disabled = slider.disabled = true;
  button.addEventListener("click", () => (frame ? pause() : play()));
  slider.addEventListener("input", show);
  played.addEventListener("change", () => {
    pause();
    slider.value = 0;
    const moments = track() ? flights.events.map(({ begin_s: time }) => Math.round((STEPS * time) / length())) : [];
    byId("moments").replaceChildren(...moments.map((value) => element("option", { value })));
    show();
  });
  store.on(["scenario", "opened"], () => {
    pause();
    offer();
    button.disabled = slider.disabled = store.scenario === null;
    slider.value = 0;
    show();
  });
  store.on(["plan"], show);
  return { play, offer };

  /** Offer to play the flown trials of a report on the plan on show, beside the plan, or `alone`.
   * @param {any} report */
  function offer({ series, events } = {}, how = { alone: false }) {
    const tracks = series?.tracks ?? [];
    flights = { tracks, times: series?.track_time_s ?? [], events: events ?? [], landmarks: series?.ground?.landmarks ?? [] };
    const plan = element("option", { value: "" }, "The plan");
    played.replaceChildren(plan, ...options(tracks.map(({ trial }) => `Flight ${trial + 1}`)));
    alone = how.alone;
    played.hidden = happening.hidden = alone || !tracks.length;
    played.value = alone ? "0" : "";
    show();
  }

  /** The track that is chosen; null for the plan itself. */
  function track() {
    return flights.tracks[played.value || -1] ?? null;
  }

  /** The length in s of what is played. */
  function length() {
    return track() ? flights.times.at(-1) : store.plan.period_s;
  }

  /** What passes in PERIOD_MS, in s. */
  function period() {
    return alone ? length() / RUNS : store.plan.period_s;
  }

  function pause() {
    cancelAnimationFrame(frame);
    frame = 0;
    button.textContent = "Play";
    button.setAttribute("aria-pressed", "false");
  }

  /** Play on and on, or `once` until the end. */
  function play({ once = false } = {}) {
    if (!store.plan) return;
    button.textContent = "Pause";
    button.setAttribute("aria-pressed", "true");
    let last = performance.now();
    const step = (now) => {
      const on = (STEPS * (now - last) * period()) / (PERIOD_MS * length());
      if (on >= 1) {
        last = now;
        const moment = Number(slider.value) + Math.round(on);
        slider.value = moment % STEPS;
        show();
        if (once && moment >= STEPS) {
          pause();
          return;
        }
      }
      frame = requestAnimationFrame(step);
    };
    frame = requestAnimationFrame(step);
  }

  /** Show the moment of the slider. */
  function show() {
    const { plan } = store;
    if (!plan) return;
    const time = (length() * Number(slider.value)) / STEPS;
    byId("moment-text").textContent = `${shown(time)} s`;
    slider.setAttribute("aria-valuetext", `${shown(time)} seconds`);
    const now = track() ? eventsAt(flights.events, time) : [];
    const words = now.map(({ what }) => what).join("; ");
    if (words !== happening.textContent) happening.textContent = words;
    if (track()) map.flown(momentOfFlight(track(), flights, period(), time, now));
    else map.moment(time);
    const timeline = charts.timeline();
    if (!timeline || alone) return;
    const others = (timeline.layout.shapes || []).filter((one) => one.name !== "moment");
    const at = time % plan.period_s;
    reshape(timeline, [...others, { name: "moment", type: "line", xref: "x", yref: "paper", x0: at, x1: at, y0: 0, y1: 1, line: { width: 2, color: "#d55e00" } }]);
  }
}
