// Plotly, which loads while the first plan is being made, and how a figure is fitted to its frame.

import { byId } from "./elements.js";

const NARROW_PX = 480;
const NARROW_MARGIN = { l: 44, r: 8, t: 8, b: 30 };
const NARROW_NAME = 34;
const LEAST_HEIGHT_PX = 180;
const CONFIG = { displayModeBar: false, responsive: true, scrollZoom: false, doubleClick: "reset" };

const loaded = new Promise((resolve, reject) => {
  if (globalThis.Plotly) resolve(globalThis.Plotly);
  const script = byId("plotly");
  script.addEventListener("load", () => resolve(globalThis.Plotly));
  script.addEventListener("error", () => reject(new Error("the drawing library did not load; reload the page")));
});

/** Whether a map's frame has no room for a legend. */
export function isNarrow(frame) {
  return frame.clientWidth < NARROW_PX;
}

/** Draw a figure in a frame that has a heading of its own; resolves once it is there. */
export async function draw(frame, figure, { filling = false } = {}) {
  const Plotly = await loaded;
  const { title, height, ...layout } = figure.layout;
  const narrow = filling && isNarrow(frame);
  if (filling) frame.parentElement.style.height = narrow ? `${heightOf(layout, frame.clientWidth)}px` : "";
  const fitted = {
    ...layout,
    ...(filling ? { autosize: true } : { height }),
    margin: { ...layout.margin, t: filling ? 16 : 28 },
    ...(narrow ? bare(layout) : {}),
    dragmode: false,
    updatemenus: [],
    sliders: [],
  };
  // the map fills its frame; with constrained domains Plotly.react keeps the range of the map before
  if (filling) for (const name of ["xaxis", "yaxis"]) fitted[name] = { ...fitted[name], constrain: "range" };
  const data = !filling && isNarrow(frame) ? figure.data.map(folded) : figure.data;
  return Plotly.react(frame, data, fitted, CONFIG);
}

/** A trace whose entry in the legend fits a narrow frame. */
function folded(trace) {
  if (!trace.name || trace.name.length <= NARROW_NAME) return trace;
  const lines = [""];
  for (const word of trace.name.split(" ")) {
    const longer = `${lines.at(-1)} ${word}`.trim();
    if (longer.length <= NARROW_NAME) lines[lines.length - 1] = longer;
    else lines.push(word);
  }
  return { ...trace, name: lines.join("<br>") };
}

/** A map without what a narrow frame has no room for: its legend, and the titles of its axes. */
function bare({ xaxis, yaxis }) {
  const untitled = (axis) => ({ ...axis, title: { text: "" }, automargin: false });
  return { showlegend: false, margin: NARROW_MARGIN, xaxis: untitled(xaxis), yaxis: untitled(yaxis) };
}

/** The height in px at which a map of that width, both axes to one scale, leaves nothing empty. */
function heightOf({ xaxis, yaxis }, width) {
  const span = ({ range }) => Math.abs(range[1] - range[0]);
  const { l, r, t, b } = NARROW_MARGIN;
  const wanted = t + b + ((width - l - r) * span(yaxis)) / span(xaxis);
  return Math.round(Math.min(Math.max(wanted, LEAST_HEIGHT_PX), 0.7 * innerHeight));
}

/** Show one frame of an animation that was drawn: Plotly.animate stalls where a page is hidden. */
export async function showFrame(frame, { data, traces }) {
  const Plotly = await loaded;
  const now = [...frame.data];
  traces.forEach((k, i) => {
    const marker = { ...now[k].marker, ...data[i].marker };
    now[k] = { ...now[k], ...data[i], marker };
  });
  return Plotly.react(frame, now, frame.layout, CONFIG);
}

/** Show more of a map: from and to in m along each axis. */
export async function widen(frame, x, y) {
  const Plotly = await loaded;
  return Plotly.relayout(frame, { "xaxis.range": x, "yaxis.range": y });
}

/** Change what lies over a figure. */
export async function reshape(frame, shapes) {
  const Plotly = await loaded;
  return Plotly.relayout(frame, { shapes });
}
