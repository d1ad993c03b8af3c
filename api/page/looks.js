// How marks look on the map: one colour means one thing, and a shape or a dash repeats it. What is switched off is
// hollow or dotted.

import { rounded } from "./scenario.js";
import { Disc, Feature, Fill, Point, RegularShape, Stroke, Style, Text } from "./vendor/openlayers.js";

const FONT = '600 13px Inter, system-ui, "DejaVu Sans", Arial, sans-serif';
const PEN = Object.assign(/** @type {any} */ (document.createElement("canvas").getContext("2d")), { font: FONT });
/** Colour and dash of a link by its rank; 0 for one that never meets. */
const COLOURS = { 3: "strong", 2: "weak", 1: "weak", 0: "lost" };
const DASHES = { 3: undefined, 2: [9, 5], 1: [2, 5], 0: [3, 8] };
const ARROW = 7;
/** how far from its point a name begins, in pixels */
const NAME_PX = { centre: 8, landmark: 13 };

/** The looks of all kinds of marks, in the colours of the page's theme. */
export class Looks {
  #ink = {};
  #made = new Map();

  constructor() {
    const page = getComputedStyle(document.documentElement);
    for (const name of ["ink", "soft", "card", "circle", "contact", "strong", "weak", "lost", "motion", "kept-out", "obstacle", "estimate", "line"]) {
      this.#ink[name] = page.getPropertyValue(`--${name}`).trim();
    }
  }

  /** Return the styles of what is being drawn: its band to the pointer, and the lengths of its edges. */
  ofSketch(feature) {
    const geometry = feature.getGeometry();
    const band = new Style({ stroke: stroke(this.#ink.circle, 2, [6, 4]), fill: new Fill({ color: `${this.#ink.circle}18` }), image: new Disc({ radius: 4, fill: new Fill({ color: this.#ink.circle }) }) });
    if (geometry.getType() !== "LineString") return band;
    const named = lengthsOf(geometry.getCoordinates()).map(({ middle, name }) => {
      const style = MAKERS.length(this.#ink);
      style.setGeometry(new Point(middle));
      style.getText()?.setText(name);
      return style;
    });
    return [band, ...named];
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
    if (one.toward !== undefined) placeName(style.getText(), one.toward, NAME_PX[one.kind]);
    return style;
  }
}

/** Return the middle and the length in words of each edge of a path [x, y], ... */
export function lengthsOf(path) {
  return path.slice(1).map(([toX, toY], k) => {
    const [x, y] = path[k];
    return { middle: [(x + toX) / 2, (y + toY) / 2], length: Math.hypot(toX - x, toY - y) };
  }).filter(({ length }) => length > 0).map(({ middle, length }) => ({ middle, name: `${rounded(length, 3)} m` }));
}

/** Return the width of a mark's name, in pixels. */
export const widthOf = (name) => PEN.measureText(name).width;

/** Return a feature of the map: what it is decides how it looks. */
export function mark(geometry, properties) {
  return new Feature({ geometry, ...properties });
}

const stroke = (color, width, lineDash) => new Stroke({ color, width, lineDash, lineCap: "round" });

const named = (ink, offsetY) =>
  new Text({ font: FONT, fill: new Fill({ color: ink.ink }), stroke: new Stroke({ color: ink.card, width: 4 }), offsetY });

/** Put a name beside its point, in a direction in rad. */
function placeName(text, toward, away) {
  const [east, north] = [Math.cos(toward), Math.sin(toward)].map((part) => Math.sign(Math.round(part * 2)) * away);
  text.setTextAlign(east > 0 ? "left" : east < 0 ? "right" : "center");
  text.setOffsetX(east);
  text.setOffsetY(-north * 1.5);
}

/** Draw the part of a circle between two angles. */
function drawArc(ink) {
  return (pixels, { context, feature, pixelRatio }) => {
    const [[x, y], [rimX, rimY]] = /** @type {number[][]} */ (pixels);
    const [begin, end] = [feature.get("begin"), feature.get("end")].sort((least, most) => least - most);
    context.save();
    Object.assign(context, { strokeStyle: ink.contact, lineWidth: 4.5 * pixelRatio, lineCap: "round" });
    context.setLineDash([]);
    context.beginPath();
    context.arc(x, y, Math.hypot(rimX - x, rimY - y), -begin, -end, true);
    context.stroke();
    context.restore();
  };
}

/** The fill and edge of a mark; hollow where it is off. */
const filled = (ink, color, off) => ({ fill: new Fill({ color: off ? ink.card : color }), stroke: new Stroke({ color: off ? ink.soft : ink.card, width: 1.5 }) });
const coordinate = (ink, textAlign, offset) =>
  new Style({ text: new Text({ font: FONT.replace("600 13px", "11px"), fill: new Fill({ color: ink.soft }), stroke: new Stroke({ color: ink.card, width: 3 }), textAlign, ...offset }) });

const MAKERS = {
  graticule: (ink) => new Style({ stroke: stroke(ink.line, 1) }),
  parallel: (ink) => coordinate(ink, "right", { offsetX: -84, offsetY: -8 }),
  meridian: (ink) => coordinate(ink, "left", { offsetX: 4, offsetY: -36 }),
  area: (ink) => new Style({ stroke: stroke(ink.soft, 2.5, [12, 6]), fill: new Fill({ color: `${ink.circle}14` }) }),
  "keep-out": (ink) => new Style({ stroke: stroke(ink["kept-out"], 2.5), fill: new Fill({ color: `${ink["kept-out"]}33` }) }),
  obstacle: (ink) => new Style({ stroke: stroke(ink.obstacle, 1.5), fill: new Fill({ color: `${ink.obstacle}66` }) }),
  beside: (ink) => new Style({ stroke: stroke(ink.soft, 1.5, [7, 5]) }),
  // one that breaks a rule is wider, too
  circle: (ink, { off, rank }) => new Style({ stroke: off ? stroke(ink.soft, 1.5, [2, 6]) : rank === 0 ? stroke(ink.lost, 4) : stroke(ink.circle, 1.5) }),
  edge: (ink) => new Style({ stroke: stroke(ink.lost, 5), zIndex: 1 }),
  contact: (ink) => new Style({ renderer: drawArc(ink) }),
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
  length: (ink) => new Style({ text: named(ink, -10), zIndex: 7 }),
  path: (ink) => new Style({ stroke: stroke(ink.contact, 1.5) }),
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
