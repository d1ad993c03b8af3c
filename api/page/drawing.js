// Plotly, which loads while the first plan is being made, and how a figure is fitted to its frame.

import { byId } from "./elements.js";

const NARROW_PX = 480;
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
  const fitted = {
    ...layout,
    ...(filling ? { autosize: true } : { height }),
    margin: { ...layout.margin, t: filling ? 16 : 28, ...(narrow ? { b: 50 } : {}) },
    ...(narrow ? { showlegend: false } : {}),
    dragmode: false,
    updatemenus: [],
    sliders: [],
  };
  return Plotly.react(frame, figure.data, fitted, CONFIG);
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

/** Change what lies over a figure. */
export async function reshape(frame, shapes) {
  const Plotly = await loaded;
  return Plotly.relayout(frame, { shapes });
}
