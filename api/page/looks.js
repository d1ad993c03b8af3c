// How marks look on the map: one colour means one thing, and a shape or a dash repeats it. What is switched off is
// hollow or dotted.

import { Disc, Feature, Fill, Point, RegularShape, Stroke, Style, Text } from "./vendor/openlayers.js";

const FONT = '600 13px system-ui, "DejaVu Sans", Arial, sans-serif';
/** Colour and dash of a link by its rank; 0 for one that never meets. */
const COLOURS = { 3: "strong", 2: "weak", 1: "weak", 0: "lost" };
const DASHES = { 3: undefined, 2: [9, 5], 1: [2, 5], 0: [3, 8] };
const ARROW = 7;

/** The looks of all kinds of marks, in the colours of the page's theme. */
export class Looks {
  #ink = {};
  #made = new Map();

  constructor() {
    const page = getComputedStyle(document.documentElement);
    for (const name of ["ink", "soft", "card", "circle", "strong", "weak", "lost", "motion", "kept-out", "obstacle", "estimate", "line"]) {
      this.#ink[name] = page.getPropertyValue(`--${name}`).trim();
    }
  }

  /** Return the style of a mark. */
  of(feature) {
    const one = feature.getProperties();
    const make = MAKERS[one.kind];
    const key = `${one.kind} ${one.rank} ${one.off}`;
    if (!this.#made.has(key)) this.#made.set(key, make(this.#ink, one));
    const style = this.#made.get(key);
    if (one.kind === "motion") return [style, arrowhead(this.#ink, feature.getGeometry().getCoordinates())];
    if (one.kind === "vehicle") style.getImage().setRotation(Math.PI / 2 - one.heading);
    if (one.name) style.getText().setText(one.name);
    return style;
  }
}

/** Return a feature of the map: what it is decides how it looks. */
export function mark(geometry, properties) {
  return new Feature({ geometry, ...properties });
}

const stroke = (color, width, lineDash) => new Stroke({ color, width, lineDash, lineCap: "round" });

const named = (ink, offsetY) =>
  new Text({ font: FONT, fill: new Fill({ color: ink.ink }), stroke: new Stroke({ color: ink.card, width: 4 }), offsetY });

/** The fill and edge of a mark; hollow where it is off. */
const filled = (ink, color, off) => ({ fill: new Fill({ color: off ? ink.card : color }), stroke: new Stroke({ color: off ? ink.soft : ink.card, width: 1.5 }) });
const coordinate = (ink, textAlign, offset) =>
  new Style({ text: new Text({ font: FONT.replace("600 13px", "11px"), fill: new Fill({ color: ink.soft }), stroke: new Stroke({ color: ink.card, width: 3 }), textAlign, ...offset }) });

const MAKERS = {
  graticule: (ink) => new Style({ stroke: stroke(ink.line, 1) }),
  parallel: (ink) => coordinate(ink, "right", { offsetX: -62, offsetY: -8 }),
  meridian: (ink) => coordinate(ink, "left", { offsetX: 4, offsetY: -36 }),
  area: (ink) => new Style({ stroke: stroke(ink.soft, 1.5, [10, 6]) }),
  "keep-out": (ink) => new Style({ stroke: stroke(ink["kept-out"], 2, [4, 4]), fill: new Fill({ color: `${ink["kept-out"]}22` }) }),
  obstacle: (ink) => new Style({ stroke: stroke(ink.obstacle, 1.5), fill: new Fill({ color: `${ink.obstacle}66` }) }),
  beside: (ink) => new Style({ stroke: stroke(ink.soft, 1.5, [7, 5]) }),
  circle: (ink, { off }) => new Style({ stroke: off ? stroke(ink.soft, 1.5, [2, 6]) : stroke(ink.circle, 1.5) }),
  contact: (ink) => new Style({ stroke: stroke(ink.circle, 4.5) }),
  link: (ink, { rank, off }) => new Style({ stroke: off ? stroke(ink.soft, 1, [1, 7]) : stroke(ink[COLOURS[rank]], rank === 3 ? 2.5 : 2, DASHES[rank]), zIndex: -1 }),
  landmark: (ink, { off }) =>
    new Style({
      image: new RegularShape({ points: 5, radius: 10, radius2: 4.5, ...filled(ink, ink.ink, off) }),
      text: named(ink, 18),
      zIndex: 3,
    }),
  centre: (ink, { off }) => new Style({ image: new Disc({ radius: 2.5, ...(off ? filled(ink, ink.circle, off) : { fill: new Fill({ color: ink.circle }) }) }), text: named(ink, -13), zIndex: 2 }),
  vehicle: (ink, { off }) =>
    new Style({
      image: new RegularShape({ points: 3, radius: 9, scale: [0.8, 1.15], rotateWithView: true, ...filled(ink, ink.circle, off) }),
      zIndex: 4,
    }),
  motion: (ink) => new Style({ stroke: stroke(ink.motion, 3), zIndex: 2 }),
  // a sighting looks like its link, and is wider
  sighting: (ink, { rank }) => new Style({ stroke: stroke(ink[COLOURS[rank]], 4, DASHES[rank]), zIndex: 1 }),
  sight: (ink) => new Style({ stroke: stroke(ink.circle, 1.5, [1, 4]), fill: new Fill({ color: `${ink.circle}18` }) }),
  ellipse: (ink) => new Style({ stroke: stroke(ink.estimate, 2), fill: new Fill({ color: `${ink.estimate}33` }), zIndex: 3 }),
  ruler: (ink) => new Style({ stroke: stroke(ink.ink, 2, [6, 4]) }),
  length: (ink) => new Style({ text: named(ink, -10) }),
  tail: (ink) => new Style({ stroke: stroke(ink.circle, 2) }),
  // a cross
  event: (ink) => new Style({ image: new RegularShape({ points: 4, radius: 10, radius2: 0, angle: Math.PI / 4, stroke: new Stroke({ color: ink.ink, width: 3 }) }), text: named(ink, -18), zIndex: 6 }),
  estimate: (ink) => new Style({ image: new Disc({ radius: 7, stroke: new Stroke({ color: ink.estimate, width: 2 }) }), zIndex: 5 }),
};

/** The head of an arrow along a path. */
function arrowhead(ink, path) {
  const [[x, y], [toX, toY]] = path.slice(-2);
  const rotation = Math.PI / 2 - Math.atan2(toY - y, toX - x);
  const image = new RegularShape({ points: 3, radius: ARROW, rotation, rotateWithView: true, fill: new Fill({ color: ink.motion }) });
  return new Style({ image, geometry: new Point([toX, toY]), zIndex: 2 });
}
