// Plotly, which loads when the first chart is opened, and how a figure is fitted to its frame.

import { element } from "./elements.js";

/** a narrower frame has no room for long names in a legend */
const NARROW_PX = 480;
const NARROW_NAME = 34;
const CONFIG = { displayModeBar: false, responsive: true, scrollZoom: false, doubleClick: "reset" };

let loading = null;

/** Resolves with Plotly, which loads once a chart is to be drawn. */
function loaded() {
  loading ??= new Promise((resolve, reject) => {
    const script = element("script", { src: "assets/plotly.min.js" });
    script.addEventListener("load", () => resolve(globalThis.Plotly));
    script.addEventListener("error", () => {
      loading = null;
      script.remove();
      reject(new Error("the drawing library did not load; open the figure again"));
    });
    document.head.append(script);
  });
  return loading;
}

/** Draw a figure in a frame that has a heading of its own; resolves once it is there. */
export async function draw(frame, figure) {
  const Plotly = await loaded();
  const { title, ...layout } = figure.layout;
  const fitted = { ...layout, margin: { ...layout.margin, t: 28 }, dragmode: false, updatemenus: [], sliders: [] };
  return Plotly.react(frame, frame.clientWidth < NARROW_PX ? figure.data.map(folded) : figure.data, fitted, CONFIG);
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

/** Change what lies over a figure. */
export async function reshape(frame, shapes) {
  const Plotly = await loaded();
  return Plotly.relayout(frame, { shapes });
}
