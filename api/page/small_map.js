// A small map of a stored plan, in a row of a list.

import { element } from "./elements.js";

/** Return the map of an outline as the service lists it. */
export function smallMap({ circles, landmarks, area }) {
  const reached = [...circles.flatMap(([x, y, r]) => [[x - r, y - r], [x + r, y + r]]), ...landmarks, ...(area ?? [])];
  const [west, south, east, north] = [Math.min, Math.max].flatMap((end) => [0, 1].map((axis) => end(...reached.map((place) => place[axis]))));
  const [width, height] = [east - west, north - south];
  // north is up
  const dot = ([x, y], r, look) => element("svg:circle", { class: look, cx: x, cy: -y, r });
  return element(
    "svg:svg",
    { class: "small-map", "aria-hidden": "true", viewBox: `${west} ${-north} ${width} ${height}` },
    area && element("svg:polygon", { points: area.map(([x, y]) => `${x},${-y}`).join(" ") }),
    circles.map(([x, y, r]) => dot([x, y], r, "ring")),
    landmarks.map((place) => dot(place, Math.max(width, height) / 24, "landmark")),
  );
}
