// What a click on the map does: select, place, link, draw or measure. One tool is in hand at a time.

import { button, byId, element, notice } from "./elements.js";
import { toEdges, within } from "./geometry.js";
import { bodiesOf } from "./grips.js";
import { lengthsOf, mark } from "./looks.js";
import { decade, polygonsOf, round, withLinkToggled, withPolygon } from "./scenario.js";
import { addBody, BODIES } from "./selection.js";
import { DragBox, Draw, Modify } from "./vendor/editing.js";
import { LineString, Point, VectorLayer, VectorSource } from "./vendor/openlayers.js";

/** The tools by name: title, key, what to do with them, and the path of their icon. */
const TOOLS = {
  select: ["Select", "v", "", "M4 3l6 14 2-6 6-2z"],
  vehicle: ["Vehicle", "c", "Click where its circle has its centre. Escape ends.", "M17 10a7 7 0 1 1-14 0 7 7 0 0 1 14 0zM10 9v2M9 10h2"],
  landmark: ["Landmark", "l", "Click where it stands. Escape ends.", "M10 2l2.4 5.2 5.6.6-4.2 3.8 1.2 5.6-5-2.9-5 2.9 1.2-5.6L2 7.8l5.6-.6z"],
  link: ["Link", "k", "Click two centres: they are linked, or no longer. Escape ends.", "M6 10a2.5 2.5 0 1 1-5 0 2.5 2.5 0 0 1 5 0zM19 10a2.5 2.5 0 1 1-5 0 2.5 2.5 0 0 1 5 0zM6 10h8"],
  area: ["Area", "a", "Click the corners that all circles lie within; the first one again, or Enter, ends.", "M3 4h9l1 5 4 1v7H4z"],
  "keep-out": ["Keep-out", "o", "Click the corners; the first one again, or Enter, ends.", "M17 10a7 7 0 1 1-14 0 7 7 0 0 1 14 0zM5 5l10 10"],
  obstacle: ["Obstacle", "b", "Click the corners; the first one again, or Enter, ends.", "M2 6h16v8H2zM7 6l-4 8M12 6l-4 8M17 6l-4 8"],
  ruler: ["Ruler", "r", "Click two places.", "M2 13L13 2l5 5L7 18zM7 8l2 2M10 5l2 2"],
};
/** Tools that begin a group. */
const FIRST = ["vehicle", "area", "ruler"];
const HIT_PX = 6;
const POLYGONS = ["area", "keep-out", "obstacle"];

/** The tools of a store's map. */
export class Tools {
  #store;
  #map;
  #buttons = new Map();
  #drawn = new VectorSource();
  /** the interaction of OpenLayers that the tool in hand has @type {any} */
  #interaction = null;
  /** what is being drawn @type {any} */
  #sketch = null;
  #tool = "select";
  #ofSketch;
  /** the first end of a link @type {string | null} */
  #from = null;

  /** Make the tools of a map's canvas. */
  constructor(store, { map, areas, style, ofSketch }) {
    this.#store = store;
    this.#map = map;
    this.#ofSketch = ofSketch;
    map.addLayer(new VectorLayer({ source: this.#drawn, style }));
    for (const [name, [title, key, , path]] of Object.entries(TOOLS)) {
      const letter = key.toUpperCase();
      const icon = element("svg:svg", { viewBox: "0 0 20 20", "aria-hidden": "true" }, element("svg:path", { d: path }));
      const content = [icon, element("span", { class: "longer" }, title), element("kbd", { "aria-hidden": "true" }, letter)];
      this.#buttons.set(name, button(content, () => this.take(name), { class: FIRST.includes(name) && "first", "aria-pressed": name === "select", title: `${title} (${letter})` }));
    }
    byId("tools").append(...this.#buttons.values());
    map.on("singleclick", (event) => this.#click(event));
    const box = new DragBox({ className: "box", condition: ({ originalEvent: { shiftKey } }) => shiftKey && this.#tool === "select" });
    box.on("boxend", () => this.#chooseWithin(box.getGeometry()));
    map.addInteraction(box);
    this.#letCornersMove(areas);
    store.on(["opened"], () => this.abandon());
    // who turns to something else has drawn what is there
    document.addEventListener("pointerdown", ({ target }) => this.corners && !byId("map").contains(/** @type {Node} */ (target)) && this.take("select"));
  }

  /** The name of the tool in hand. */
  get tool() {
    return this.#tool;
  }

  /** How many corners are drawn of a polygon. */
  get corners() {
    const [ring = []] = this.#sketch?.getGeometry().getCoordinates() ?? [];
    // the pointer, and the first corner again
    return POLYGONS.includes(this.#tool) ? Math.max(0, ring.length - 2) : 0;
  }

  /** Lay the tool away, and what is half drawn with it. */
  abandon() {
    this.#sketch = null;
    this.take("select");
  }

  /** Take a tool in hand; a polygon of three corners or more that is being drawn is kept. */
  take(name) {
    if (this.corners > 2) this.#interaction.finishDrawing();
    else if (this.corners) notice("Fewer than three corners: nothing is drawn.");
    this.#sketch = null;
    this.#tool = name;
    this.#from = null;
    this.#drawn.clear(true);
    if (this.#interaction) this.#map.removeInteraction(this.#interaction);
    this.#interaction = null;
    if (POLYGONS.includes(name)) this.#draw("Polygon", (corners) => this.#keep(name, corners[0].slice(0, -1)));
    if (name === "ruler") this.#draw("LineString", (ends) => this.#measure(ends));
    for (const [other, button] of this.#buttons) button.setAttribute("aria-pressed", other === name);
    byId("map").dataset.tool = name;
    byId("tool-help").textContent = TOOLS[name][2];
  }

  /** Use a key for a tool; returns whether it is that of one. */
  key(letter) {
    const name = Object.keys(TOOLS).find((one) => TOOLS[one][1] === letter);
    if (name) this.take(name);
    return Boolean(name);
  }

  /** Take a body for the tool in hand; returns whether the tool has a use for it. */
  uses(body) {
    if (this.#tool !== "link") return false;
    if (body.kind !== "vehicle") return true;
    if (this.#from === null) {
      this.#from = body.title;
      byId("tool-help").textContent = `From ${body.title} to: click another centre.`;
    } else if (this.#from !== body.title) {
      const changed = withLinkToggled(this.#store.scenario, this.#store.plan, [this.#from, body.title]);
      this.#from = null;
      byId("tool-help").textContent = TOOLS.link[2];
      this.#store.edit(changed);
    }
    return true;
  }

  #click({ coordinate: [x, y] }) {
    if (this.#tool === "select") {
      const near = HIT_PX * this.#map.getView().getResolution();
      // an area is taken by its edge: all else lies within it
      const hit = polygonsOf(this.#store.scenario).filter(({ kind, corners }) => toEdges(corners, { x, y }) <= near || (kind !== "area" && within(corners, { x, y })));
      const { kind, k } = hit[hit.length - 1] ?? {};
      this.#store.select(kind ? { kind, k } : null);
    }
    if (!(this.#tool in BODIES)) return;
    addBody(this.#store, this.#tool, { x: tidied(x, this.#map), y: tidied(y, this.#map) });
  }

  #chooseWithin(box) {
    const inside = bodiesOf(this.#store.scenario, null).filter(({ x, y }) => box.intersectsCoordinate([x, y]));
    this.#store.selectAll(inside.map(({ kind, k }) => ({ kind, k })));
    notice(inside.length ? `${inside.length} selected.` : "");
  }

  /** Corners of polygons move, a point of an edge becomes a corner, and a click with Alt takes one out. */
  #letCornersMove(areas) {
    const modify = new Modify({ source: areas, ...(matchMedia("(pointer: coarse)").matches && { style: [] }), condition: ({ originalEvent: { shiftKey } }) => !shiftKey && this.#tool === "select" });
    modify.on("modifyend", ({ features }) => {
      const changed = features.getArray().reduce((scenario, one) => {
        const [corners] = /** @type {any} */ (one.getGeometry()).getCoordinates();
        return withPolygon(scenario, one.get("kind"), corners.slice(0, -1).map((corner) => corner.map((value) => tidied(value, this.#map))), one.get("k"));
      }, this.#store.scenario);
      this.#store.edit(changed);
    });
    this.#map.addInteraction(modify);
  }

  #draw(type, ended) {
    this.#interaction = new Draw({ type, maxPoints: type === "LineString" ? 2 : undefined, style: this.#ofSketch });
    this.#interaction.on("drawstart", ({ feature }) => (this.#sketch = feature));
    this.#interaction.on("drawend", ({ feature }) => {
      this.#sketch = null;
      ended(feature.getGeometry().getCoordinates());
    });
    this.#map.addInteraction(this.#interaction);
  }

  #keep(kind, corners) {
    const tidy = corners.map((corner) => corner.map((value) => tidied(value, this.#map)));
    this.#store.edit(withPolygon(this.#store.scenario, kind, tidy));
    // once the drawing is over
    setTimeout(() => this.#tool === kind && this.abandon());
  }

  #measure(ends) {
    const [{ middle, name }] = lengthsOf(ends);
    this.#drawn.clear(true);
    this.#drawn.addFeatures([mark(new LineString(ends), { kind: "ruler" }), mark(new Point(middle), { kind: "length", name })]);
    byId("tool-help").textContent = name;
  }
}

/** A coordinate rounded to the size of a pixel. */
export function tidied(value, map) {
  const tidy = decade(map.getView().getResolution());
  return round(Math.round(value / tidy) * tidy);
}
