// What a figure's marks mean, as a list under it, where its own legend has no room.

import { drawn, element } from "./elements.js";

const DASHES = { dash: "6 4", dot: "2 3", dashdot: "6 3 2 3", longdash: "9 4" };
const STAR = "M12 1l3 7 7 .5-5.5 4.5 2 7-6.5-4-6.5 4 2-7L2 8.5 9 8z";
const ARROW = "M12 2l7 17-7-4-7 4z";

/** Return an item for each trace that the figure's legend would name. */
export function legendOf(figure) {
  const named = figure.data.filter((one) => one.showlegend !== false && one.visible !== "legendonly" && one.name);
  return named.map((one) => element("li", {}, swatch(one), one.name.replaceAll("<br>", " ")));
}

function swatch({ mode, line, marker }) {
  const drawing = drawn("svg", { viewBox: "0 0 24 22", width: 24, height: 22, "aria-hidden": "true" });
  if (mode.includes("lines")) {
    const look = { stroke: line.color, "stroke-width": line.width, "stroke-dasharray": DASHES[line.dash] || "none" };
    drawing.append(drawn("line", { x1: 0, x2: 24, y1: 11, y2: 11, ...look }));
  } else if (mode.includes("markers")) {
    drawing.append(drawn("path", { d: marker.symbol === "star" ? STAR : ARROW, fill: marker.color }));
  }
  return drawing;
}
