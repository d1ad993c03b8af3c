// Handles over the map: buttons that pointer and keyboard move, each over a grip.
//
// A canvas has no accessibility tree, so what can be moved is a button. One of them is the stop of the
// Tab key; arrow keys move the selection, Page keys go to the next handle.

import { coordinatesOf } from "./coordinates.js";
import { byId, element } from "./elements.js";
import { gripsOf, movedTo, withoutCorner } from "./grips.js";
import { decade, landmarksOf } from "./scenario.js";
import { BODIES, withPlaces } from "./selection.js";
import { tidied } from "./tools.js";

const STEP = 0.01;
const LONG_STEP = 0.05;
const TREMOR_PX = 4;
const SAME_M = 1e-6;
const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** Handles of a store's scenario over a map's canvas; `uses(grip)` returns whether the tool in hand takes a grip for itself. */
export class Handles {
  #store;
  #map;
  #turned;
  #uses;
  #group = byId("handles");
  /** what is dragged: `{ handle, first, at, grip }`
   * @type {any} */
  #held = null;
  /** whether the click that ends a drag is still to come */
  #dragged = false;

  constructor(store, { map, turned }, uses) {
    this.#store = store;
    this.#map = map;
    this.#turned = turned;
    this.#uses = uses;
    map.on("postrender", () => this.place());
    store.on(["degrees"], () => this.place());
    // over a handle, too, the wheel zooms
    this.#group.addEventListener("wheel", (event) => {
      event.preventDefault();
      map.getViewport().dispatchEvent(new WheelEvent(event.type, event));
    });
    document.addEventListener("keydown", (event) => event.key === "Escape" && this.#takeBack());
    map.render();
  }

  /** Put every handle over its grip; one out of view is hidden, unless it is held. */
  place() {
    const size = this.#map.getSize();
    if (!this.#store.scenario || !size) return;
    const grips = this.#grips;
    const handles = this.#all;
    for (const handle of handles.slice(grips.length)) handle.remove();
    const pixels = grips.map(({ x, y }) => this.#map.getPixelFromCoordinate([x, y]) ?? [-1, -1]);
    const away = pixels.map(([left, top]) => left < -TREMOR_PX || top < -TREMOR_PX || left > size[0] + TREMOR_PX || top > size[1] + TREMOR_PX);
    const stop = this.#stopOf(grips, away);
    grips.forEach((grip, k) => {
      const handle = handles[k] || this.#newHandle();
      const [left, top] = pixels[k];
      handle.grip = grip;
      handle.hidden = away[k] && this.#held?.handle !== handle;
      const look = `handle ${grip.kind}${this.#isJudged(grip) ? "" : " moved"}`;
      const pressed = this.#store.isSelected(grip);
      const tabIndex = k === stop ? 0 : -1;
      // what is the same costs the browser nothing
      const label = this.#store.off.includes(grip.title) ? `${grip.label}, switched off` : grip.label;
      const state = [look, pressed, tabIndex, label, left, top].join();
      if (handle.state === state) return;
      const [x, y] = [left, top].map((pixel, axis) => Math.min(Math.max(pixel, 0), size[axis]));
      Object.assign(handle.style, { left: `${x}px`, top: `${y}px` });
      Object.assign(handle, { state, className: look, title: grip.title, tabIndex, ariaPressed: pressed, ariaLabel: label });
    });
  }

  get #grips() {
    const { scenario, drawn, selected } = this.#store;
    return gripsOf(scenario, drawn, selected, this.#turned(), coordinatesOf(this.#store).words);
  }

  /** @returns {any[]} */
  get #all() {
    return [...this.#group.children];
  }

  /** The number of the handle that is the stop of the Tab key: that of what is selected, else the first in view. */
  #stopOf(grips, away) {
    const { selected } = this.#store;
    const chosen = grips.findIndex(({ kind, k }, at) => !away[at] && selected?.kind === kind && selected.k === k);
    return chosen < 0 ? away.indexOf(false) : chosen;
  }

  /** Give a handle the focus; the view moves to it where it is hidden. */
  #focus(handle) {
    if (handle.hidden) {
      const { x, y } = handle.grip;
      this.#map.getView().setCenter([x, y]);
      this.#map.renderSync();
    }
    handle.focus({ preventScroll: true });
  }

  /** Whether the plan on show has a body where the scenario has it: not while an edit waits or is at fault. */
  #isJudged(body) {
    const { plan } = this.#store;
    if (!plan) return false;
    if (!(body.kind in BODIES)) return true;
    const drawn = body.kind === "vehicle" ? plan.vehicles[body.k] : landmarksOf(plan.scenario)[body.k];
    if (!drawn) return false;
    const [x, y] = drawn.center_m || [drawn.x, drawn.y];
    return Math.hypot(x - body.x, y - body.y, body.radius - (drawn.radius_m ?? 0)) <= SAME_M;
  }

  #newHandle() {
    const handle = element("button", { type: "button" });
    handle.addEventListener("pointerdown", (event) => this.#grab(handle, event));
    handle.addEventListener("pointermove", (event) => this.#drag(handle, event));
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      handle.addEventListener(name, () => this.#drop(handle));
    }
    handle.addEventListener("keydown", (event) => this.#key(handle, event));
    // a click by the keyboard, too
    handle.addEventListener("click", (event) => {
      // what was dragged stays selected as it is
      if (this.#dragged) this.#dragged = false;
      else this.#choose(handle.grip, event);
    });
    this.#group.append(handle);
    return handle;
  }

  /** Select a body: alone, or with Shift beside what is selected. */
  #choose(grip, { shiftKey, dragged = false }) {
    if (grip.kind in BODIES && !this.#uses(grip)) this.#store.select({ kind: grip.kind, k: grip.k }, { more: shiftKey, dragged });
  }

  #grab(handle, event) {
    if (event.button !== 0) return;
    this.#dragged = false;
    handle.setPointerCapture(event.pointerId);
    const box = handle.getBoundingClientRect();
    const grip = [event.clientX - (box.left + box.width / 2), event.clientY - (box.top + box.height / 2)];
    this.#held = { handle, first: true, at: [event.clientX, event.clientY], grip };
  }

  #drag(handle, event) {
    if (this.#held?.handle !== handle) return;
    const { at, grip, first } = this.#held;
    // a click by an unsteady hand is none of a drag
    if (first && Math.hypot(event.clientX - at[0], event.clientY - at[1]) < TREMOR_PX) return;
    if (first && handle.grip.kind in BODIES && !this.#store.isSelected(handle.grip)) this.#choose(handle.grip, { shiftKey: false, dragged: true });
    const box = this.#map.getTargetElement().getBoundingClientRect();
    const pixel = [event.clientX - grip[0] - box.left, event.clientY - grip[1] - box.top];
    const [x, y] = this.#map.getCoordinateFromPixel([Math.min(Math.max(pixel[0], 0), box.width), Math.min(Math.max(pixel[1], 0), box.height)]);
    this.#move(handle.grip, { x: tidied(x, this.#map), y: tidied(y, this.#map) }, { live: true, step: first });
    this.#held.first = false;
  }

  #drop(handle) {
    if (this.#held?.handle !== handle) return;
    const moved = !this.#held.first;
    this.#held = null;
    this.#dragged = moved;
    if (moved) this.#store.edit(this.#store.scenario, { step: false });
  }

  /** End a drag as if it had not begun. */
  #takeBack() {
    if (!this.#held) return;
    const moved = !this.#held.first;
    this.#held = null;
    if (moved) this.#store.undo();
  }

  #key(handle, event) {
    const next = { PageDown: 1, PageUp: -1 }[event.key];
    if (next) {
      event.preventDefault();
      const all = this.#all;
      const other = all[(all.indexOf(handle) + next + all.length) % all.length];
      this.#choose(other.grip, { shiftKey: event.shiftKey });
      this.#focus(other);
      return;
    }
    if (event.key === "Delete" && handle.grip.kind === "corner") {
      event.preventDefault();
      event.stopPropagation();
      this.#store.edit(withoutCorner(this.#store.scenario, handle.grip));
      return;
    }
    const way = WAYS[event.key];
    if (!way) return;
    event.preventDefault();
    const width = this.#map.getSize()[0] * this.#map.getView().getResolution();
    const step = width * (event.shiftKey ? LONG_STEP : STEP);
    const tidy = decade(step);
    const by = Math.round(step / tidy) * tidy;
    // where it is by now: handles follow with the next frame
    const grip = this.#grips.find(({ title }) => title === handle.grip.title) ?? handle.grip;
    const at = { x: tidied(grip.x + way[0] * by, this.#map), y: tidied(grip.y + way[1] * by, this.#map) };
    this.#move(grip, at, { live: true, field: grip.title });
    requestAnimationFrame(() => handle.hidden && this.#focus(handle));
  }

  /** Move a grip to a place; of several selected bodies, all by as much. */
  #move(grip, to, how) {
    const { scenario, drawn, chosen } = this.#store;
    const many = chosen.length > 1 && this.#store.isSelected(grip);
    if (!many) {
      const { scenario: changed, phase } = movedTo(scenario, drawn, grip, to, this.#turned());
      this.#store.edit(changed, { ...how, phase });
      return;
    }
    const [x, y] = [to.x - grip.x, to.y - grip.y];
    this.#store.edit(withPlaces(scenario, chosen, (one) => ({ x: one.x + x, y: one.y + y })), how);
  }
}
