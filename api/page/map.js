// The formation on a map that people zoom and pan.
//
// The map is drawn in the page from numbers: the scenario's places, the plan's phases and ranks. Its
// view changes only when people change it, or open another scenario.

import { byId } from "./elements.js";
import { TURN } from "./geometry.js";
import { arcOf, between, brokenBy, circlesOf, extentOf, linksOf, motionsOf, pointsOf, poseAt, roomAbout, settled, sightOf, titleOf } from "./marks.js";
import { lengthsOf, Looks, mark, widthOf } from "./looks.js";
import { namesOf, placesIn, polygonsOf } from "./scenario.js";
import { DragPan, LineString, MouseWheelZoom, OlMap, PinchZoom, Point, Polygon, Projection, Ring, ScaleLine, VectorLayer, VectorSource, View } from "./vendor/openlayers.js";

const MARGIN_PX = 36;
const BUTTONS_PX = 72;
const TOOLS_PX = 158;
/** as in page.css */
const NARROW = matchMedia("(max-width: 60em)");
const FURTHEST_M = 1e7;
/** what symbols and names of marks take above or below their geometry, and beside it, with the width of a name */
const ABOVE_PX = 32;
const BESIDE_PX = 16;
/** how long circles move after undo, or when another plan of the team is opened */
const GLIDE_MS = 350;
const CALM = matchMedia("(prefers-reduced-motion: reduce)");
const NOTHING = [Infinity, Infinity, -Infinity, -Infinity];

const PLANE = new Projection({ code: "plane", units: "m", extent: [-FURTHEST_M, -FURTHEST_M, FURTHEST_M, FURTHEST_M] });

/** Marks of which a part [west, south, east, north] in m is drawn, or all. */
class Marks extends VectorSource {
  /** @type {number[] | null} */
  part = null;

  getFeaturesInExtent(all) {
    const [west, south, east, north] = this.part ?? all;
    return super.getFeaturesInExtent([Math.max(west, all[0]), Math.max(south, all[1]), Math.min(east, all[2]), Math.min(north, all[3])]);
  }
}

/** The map: draws a store's scenario and plan, and turns handles that move into edits. */
export class FormationMap {
  #store;
  #frame = byId("map-plot");
  #areas = new VectorSource();
  #sources = { still: new Marks(), moving: new Marks() };
  #looks = new Looks();
  #map;
  /** marks that are drawn, by their signatures */
  #drawn = { still: new Map(), moving: new Map() };
  /** [west, south, east, north] in m of marks that changed since the map was drawn, and what else it shows */
  #changed = NOTHING;
  #shown = "";
  /** the part that is drawn now, null for all @type {any} */
  #part = null;
  /** width of the widest name, in pixels */
  #widest = 0;
  /** all layers, those of tools as well @type {any[]} */
  #layers = [];
  /** what marks are drawn on @type {any} */
  #context = null;
  /** circles and links that are drawn @type {any} */
  #scene = null;
  /** the frame that is waited for */
  #due = 0;
  /** whether all that is due comes of a drag that goes on */
  #live = true;
  /** what was on show after all was fitted into the window */
  #whole = "";
  /** the polygons that are drawn, as text */
  #polygons = "";
  /** what is played: s since the start of the period, or the marks of a flown trial */
  #time = 0;
  /** @type {any[] | null} */
  #flown = null;
  /** marks that are drawn instead of the scenario, or null @type {any[] | null} */
  #instead = null;
  /** points of what lies around a vehicle, by its name, place and the time, or null @type {(name: string, place: {x: number, y: number}, time: number) => number[][] | null} */
  #around = () => null;
  /** the grid, or the earth below where a scenario has a place on it @type {any} */
  #ground = null;
  /** the scenario that was drawn last, and from which circles move on, until when @type {{drawn: any, from: any, until: number}} */
  #glide = { drawn: null, from: null, until: 0 };

  constructor(store) {
    this.#store = store;
    const style = (feature) => this.#looks.of(feature);
    const layer = (source) => new VectorLayer({ source, style, updateWhileInteracting: true });
    const own = Object.values(this.#sources).map(layer);
    this.#map = new OlMap({
      target: this.#frame,
      controls: [new ScaleLine({ minWidth: 40 })],
      interactions: [new DragPan(), new MouseWheelZoom(), new PinchZoom()],
      layers: [layer(this.#areas), ...own],
      view: new View({ projection: PLANE, center: [0, 0], resolution: 1, constrainRotation: false, enableRotation: false, showFullExtent: true }),
    });
    this.#frame.map = this.#map;
    own[0].on("prerender", ({ context }) => (this.#context = context));
    this.#map.on("precompose", () => this.#part ? this.#clip(this.#part) : this.#draws(null));
    this.#map.on("postcompose", ({ frameState }) => {
      if (this.#part) this.#context.restore();
      this.#layers = /** @type {any} */ (frameState).layerStatesArray.map(({ layer }) => layer);
      [this.#shown, this.#changed, this.#part, this.#live] = [this.#picture, NOTHING, null, true];
    });
    this.#map.on("pointermove", ({ coordinate }) => this.#point(coordinate));
    store.on(["opened"], () => {
      this.#glideOn();
      this.fit();
      this.#map.once("rendercomplete", () => performance.mark("map"));
    });
    store.on(["scenario", "opened", "plan", "selected", "beside", "off"], ({ live, quick }) => this.#drawSoon(live || quick));
    store.on(["scenario"], ({ restored }) => restored && this.#glideOn());
    store.on(["scenario", "opened"], () => this.#layGround(style));
    byId("map-legend").addEventListener("toggle", () => this.#explain());
    store.on(["selected"], ({ reveal }) => reveal && this.#reveal());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#restyle());
    document.fonts.addEventListener("loadingdone", () => this.#restyle());
    // what was fitted to the window stays so; a view that people chose stays as it is
    this.#map.on("change:size", () => this.#viewed === this.#whole && this.fit());
    byId("fit").addEventListener("click", () => this.fit());
    byId("nearer").addEventListener("click", () => this.#zoom(1));
    byId("further").addEventListener("click", () => this.#zoom(-1));
  }

  /** What tools and handles need: the map of OpenLayers, its polygons, how marks and sketches look, and the angle in rad turned. */
  get canvas() {
    return { map: this.#map, areas: this.#areas, style: (feature) => this.#looks.of(feature), ofSketch: (feature) => this.#looks.ofSketch(feature), turned: () => this.#turned };
  }

  /** Let circles move from where they are drawn, if they are those of the same team. */
  #glideOn() {
    const { drawn } = this.#glide;
    const { scenario } = this.#store;
    const same = drawn && String(namesOf(drawn)) === String(namesOf(scenario)) && drawn.formation.centers_m && scenario.formation.centers_m;
    this.#glide = { drawn, from: drawn, until: same && !CALM.matches ? performance.now() + GLIDE_MS : 0 };
  }

  /** Move on from the scenario that was drawn before; returns the one to draw now. */
  #moveOn() {
    const { scenario } = this.#store;
    const { from, until } = this.#glide;
    const rest = (until - performance.now()) / GLIDE_MS;
    if (rest > 0) this.#drawSoon(false);
    this.#glide.drawn = rest > 0 ? between(from, scenario, 1 - rest ** 3) : scenario;
    return this.#glide.drawn;
  }

  /** Explain in the legend what is drawn, and only that. */
  #explain() {
    const legend = byId("map-legend");
    if (!legend.open) return;
    const marks = [...this.#areas.getFeatures(), ...Object.values(this.#drawn).flatMap((drawn) => [...drawn.values()])];
    const kinds = new Set(marks.map((feature) => (feature.get("off") ? "off" : [feature.get("kind"), feature.get("rank")].join(" ").trim())));
    for (const item of legend.querySelectorAll("[data-mark]")) item.hidden = !kinds.has(item.dataset.mark);
  }

  /** The ground is loaded after the map. */
  async #layGround(style) {
    const { Ground } = await import("./ground.js");
    this.#ground ??= new Ground(this.#map, style);
    this.#ground.lie(this.#store.scenario?.geo_origin);
  }

  /** Say where the pointer is. @param {any} place */
  #point([x, y]) {
    const { scenario, degrees } = this.#store;
    const words = scenario ? [degrees && scenario.geo_origin ? "" : placesIn(scenario)({ x, y }), this.#ground?.words([x, y])] : [];
    byId("pointer").textContent = words.filter(Boolean).join("; ");
  }

  /** Show all of the scenario. */
  fit() {
    const { scenario } = this.#store;
    if (!scenario) return;
    this.#map.updateSize();
    // hidden below figures
    if (!this.#map.getSize()?.every(Boolean)) return;
    this.#map.getView().fit((this.#instead && this.#sources.still.getExtent()) ?? extentOf(scenario), { padding: this.#room, maxZoom: 40 });
    this.#whole = this.#viewed;
  }

  /** Room for the tools and the view's buttons beside what is fitted, in pixels. */
  get #room() {
    return NARROW.matches ? [BUTTONS_PX, MARGIN_PX, BUTTONS_PX, MARGIN_PX] : [MARGIN_PX, BUTTONS_PX, MARGIN_PX, TOOLS_PX];
  }

  /** The part of the plane on show, as text. */
  get #viewed() {
    const view = this.#map.getView();
    return `${view.getCenter()} ${view.getResolution()}`;
  }

  /** Show all, if a part of what is selected is out of view. */
  #reveal() {
    const { scenario, chosen } = this.#store;
    const all = { vehicle: circlesOf(scenario, null), landmark: pointsOf(scenario) };
    const [west, south, east, north] = this.#map.getView().calculateExtent(this.#map.getSize());
    const bodies = chosen.flatMap(({ kind, k }) => all[kind]?.[k] ?? []);
    if (bodies.some(({ x, y, radius }) => x - radius < west || x + radius > east || y - radius < south || y + radius > north)) this.fit();
  }

  #zoom(by) {
    const view = this.#map.getView();
    view.animate({ resolution: (view.getResolution() ?? 1) * 2 ** (-by / 2), duration: 120 });
  }

  /** Show the plan so many seconds after its start. */
  moment(time) {
    this.#time = time;
    this.#flown = null;
    this.#due || this.#drawMoving();
  }

  /** Draw around each vehicle what this returns, at every moment. */
  surround(around) {
    this.#around = around;
    this.#due || this.#drawMoving();
  }

  /** Show a moment of a flown trial, as marks of the kinds that `looks` knows. */
  flown(marks) {
    this.#flown = marks;
    this.#due || this.#drawMoving();
  }

  /** Draw marks of the kinds that `looks` knows instead of the scenario, all of them in view; null ends it. */
  instead(marks) {
    this.#instead = marks;
    this.#frame.parentElement?.classList.toggle("instead", marks !== null);
    this.#drawPolygons(marks ? {} : this.#store.scenario);
    this.draw();
    this.fit();
  }

  /** Draw with the next frame, once for all that changes until then: what changed alone, if a drag goes on. */
  #drawSoon(live) {
    this.#live &&= Boolean(live);
    this.#due ||= requestAnimationFrame(() => {
      this.#due = 0;
      this.draw();
      const same = this.#live && this.#shown === this.#picture && !this.#map.getView().getAnimating();
      this.#draws(same ? this.#changed : null);
      // in this frame, not the next one
      this.#map.renderSync();
    });
  }

  /** Draw the scenario as it is, with what its plan says of it. */
  draw() {
    const { drawn: plan, beside, off, without } = this.#store;
    if (!this.#store.scenario) return;
    if (this.#instead) return this.#sync("still", this.#instead.map(made));
    const scenario = this.#moveOn();
    // each verdict of a drag shifts phases of many vehicles, by less than a pixel
    const drawn = (this.#live && this.#scene?.circles) || [];
    const circles = settled(circlesOf(scenario, plan, off), drawn, this.#map.getView().getResolution() ?? 0);
    const points = pointsOf(scenario, off);
    const links = linksOf(plan, circles, points);
    const judged = without?.unobservable ? { ...plan, observability: without } : plan;
    const broken = brokenBy(scenario, plan, circles);
    const room = roomAbout(links);
    const point = (kind, body) => pointOf(kind, body, room.get(body.name) ?? Math.PI / 2);
    this.#scene = { circles, links };
    this.#drawPolygons(scenario);
    this.#sync("still", [
      // with a line to the place at the start, by which phases differ
      ...(beside?.vehicles ?? []).map(({ name, center_m: [x, y], radius_m: radius, phase_rad: phase }) => [
        `beside ${name} ${x} ${y} ${radius} ${phase}`,
        () => mark(new LineString([[x, y], ...arcOf({ x, y, radius, phase, sense: 1 }, 0, TURN)]), { kind: "beside" }),
      ]),
      ...links.map(({ a, b, from, to, rank, off: isOff }) => [`link ${a} ${b} ${rank} ${isOff} ${from.x} ${from.y} ${to.x} ${to.y}`, () => mark(line([from, to]), { kind: "link", rank, off: isOff })]),
      ...circles.map(({ name, off, x, y, radius }) => {
        const rank = broken.names.has(name) ? 0 : undefined;
        return [`circle ${name} ${off} ${x} ${y} ${radius} ${rank}`, () => mark(new Ring([x, y], radius), { kind: "circle", body: name, off, rank })];
      }),
      ...this.#edges(scenario).map(({ middle, name }) => [`length ${middle} ${name}`, () => mark(new Point(middle), { kind: "length", name })]),
      ...broken.crossed.map((edge) => [`edge ${edge}`, () => mark(new LineString(edge), { kind: "edge" })]),
      ...links.flatMap((link) => [link.from, link.to].filter((one) => one.radius > 0).flatMap((one) => link.arcs.map(([a, b]) => contact(link, one, a, b)))),
      ...motionsOf(scenario, judged).map(({ path, turns }) => [`motion ${path}`, () => mark(new LineString(path), { kind: "motion", turns })]),
      ...points.map((landmark) => point("landmark", landmark)),
      ...circles.map((circle) => point("centre", circle)),
    ]);
    this.#drawMoving();
    this.#explain();
    this.#frame.setAttribute("aria-label", `Map of the formation: ${circles.length} vehicles, ${points.length} landmarks, ${links.length} links.`);
  }

  /** The lengths of the edges of the polygon that is selected. */
  #edges(scenario) {
    const { corners = [] } = polygonsOf(scenario).find((polygon) => this.#store.isSelected(polygon)) ?? {};
    return lengthsOf([...corners, ...corners.slice(0, 1)]);
  }

  /** Bring the marks of a source to these, `[signature, make]`: those that are drawn stay. */
  #sync(name, marks) {
    const drawn = this.#drawn[name];
    const gone = new Map(drawn);
    const made = [];
    for (const [signature, make] of marks) {
      if (gone.delete(signature) || drawn.has(signature)) continue;
      const feature = make();
      drawn.set(signature, feature);
      made.push(feature);
    }
    for (const signature of gone.keys()) drawn.delete(signature);
    this.#sources[name].removeFeatures([...gone.values()]);
    this.#sources[name].addFeatures(made);
    for (const one of [...gone.values(), ...made]) this.#change(one);
  }

  #change(mark) {
    const [west, south, east, north] = this.#changed;
    const [left, low, right, high] = mark.getGeometry().getExtent();
    this.#changed = [Math.min(west, left), Math.min(south, low), Math.max(east, right), Math.max(north, high)];
    this.#widest = Math.max(this.#widest, widthOf(mark.get("name") ?? ""));
  }

  /** What the map shows beside changes of marks, as text. */
  get #picture() {
    const sources = Object.values(this.#sources);
    const revisions = this.#layers.map((one) => one.getRevision() - (sources.find((source) => source === one.getSource())?.getRevision() ?? 0));
    return `${this.#viewed} ${this.#map.getSize()} ${revisions}`;
  }

  /** A part, with what marks have around it. */
  #withMarks([west, south, east, north]) {
    const [wide, high] = [BESIDE_PX + this.#widest, ABOVE_PX].map((pixels) => pixels * (this.#map.getView().getResolution() ?? 1));
    return [west - wide, south - high, east + wide, north + high];
  }

  /** Let marks of a part be drawn, or all: the rest of the picture is there. */
  #draws(part) {
    this.#part = part && this.#withMarks(part);
    for (const source of Object.values(this.#sources)) {
      if (!part && !source.part) continue;
      source.part = part && this.#withMarks(this.#part);
      source.changed();
    }
  }

  #clip([west, south, east, north]) {
    const [wide] = this.#map.getSize() ?? [1];
    const ratio = this.#context.canvas.width / wide;
    const [from, to] = [[west, north], [east, south]].map((one) => this.#map.getPixelFromCoordinate(one).map((value) => Math.round(value * ratio)));
    this.#context.save();
    this.#context.beginPath();
    this.#context.rect(...from, to[0] - from[0], to[1] - from[1]);
    this.#context.clip();
  }

  /** Draw the polygons, unless they are drawn: corners may be in hand. */
  #drawPolygons(scenario) {
    const polygons = polygonsOf(scenario);
    const known = JSON.stringify(polygons);
    if (known === this.#polygons) return;
    this.#polygons = known;
    this.#areas.clear();
    this.#areas.addFeatures(polygons.map(({ corners, ...which }) => mark(new Polygon([[...corners, corners[0]]]), which)));
  }

  #drawMoving() {
    const { plan, selected } = this.#store;
    if (this.#flown) {
      this.#sync("moving", this.#flown.map(made));
      return;
    }
    const turned = this.#turned;
    const { circles, links } = this.#scene ?? { circles: [], links: [] };
    const chosen = selected?.kind === "vehicle" ? circles[selected.k] : null;
    const sight = chosen && plan && !chosen.off && !chosen.blind ? [sightOf(chosen, turned)] : [];
    const inTouch = links.filter(({ arcs }) => arcs.some(([from, to]) => within(turned, from, to)));
    const poses = circles.map((one) => poseAt(one, turned));
    this.#sync("moving", [
      ...sight.map((rim) => [`sight ${rim}`, () => mark(new Polygon([rim]), { kind: "sight" })]),
      ...inTouch.map(({ from, to, rank }) => {
        const ends = [poseAt(from, turned), poseAt(to, turned)];
        return [`sighting ${rank} ${ends.map(({ x, y }) => [x, y])}`, () => mark(line(ends), { kind: "sighting", rank })];
      }),
      ...circles.map(({ name, off }, k) => {
        const { x, y, heading } = poses[k];
        return [`vehicle ${name} ${x} ${y} ${heading} ${off}`, () => mark(new Point([x, y]), { kind: "vehicle", body: name, heading, off })];
      }),
      ...circles.flatMap(({ name, off }, k) => {
        const ring = !off && this.#around(name, poses[k], this.#time);
        return ring ? [[Symbol(), () => mark(new Polygon([ring]), { kind: "ellipse", body: name })]] : [];
      }),
    ]);
  }

  /** The angle in rad turned at the moment shown. */
  get #turned() {
    const { plan } = this.#store;
    return plan && !this.#flown ? (TURN * this.#time) / plan.period_s : 0;
  }

  #restyle() {
    this.#looks = new Looks();
    for (const layer of this.#map.getLayers().getArray()) layer.changed();
  }
}

/** The part of a circle where a link meets, as a mark with the angles in rad between which it lies. */
function contact({ a, b }, { name, x, y, radius, phase, sense }, from, to) {
  const [begin, end] = [from, to].map((turned) => phase + sense * turned);
  return [`contact ${name} ${a} ${b} ${x} ${y} ${radius} ${begin} ${end}`, () => mark(new Ring([x, y], radius), { kind: "contact", begin, end })];
}

/** A path or a place as a mark. */
function made({ path, place, ...look }) {
  return [Symbol(), () => mark(path ? new LineString(path) : new Point(place), look)];
}

/** A landmark or a centre as a mark, with its name in a direction in rad from it. */
function pointOf(kind, body, toward) {
  const { x, y, off } = body;
  const name = titleOf(body);
  return [`${kind} ${name} ${x} ${y} ${toward}`, () => mark(new Point([x, y]), { kind, name, off, toward })];
}

function line(places) {
  return new LineString(places.map(({ x, y }) => [x, y]));
}

/** Whether an angle, or one a turn on, lies between two. */
function within(turned, from, to) {
  const angle = turned % TURN;
  return (angle >= from && angle <= to) || (angle + TURN >= from && angle + TURN <= to);
}
