// A link added to the selected vehicle.

import { byId, element, notice, shown } from "./elements.js";
import { gapBetween, inReach } from "./free_space.js";
import { vehiclesOf, withLinks } from "./scenario.js";

/** The row of the form that links the selected vehicle of a store's scenario to another. */
export class LinkAdding {
  /** the element to put in the form */
  element = element("div", { class: "linking" });
  #store;
  #k = 0;
  #label = element("label", { for: "link-to" }, "Link to");
  #select = element("select", { id: "link-to", "aria-describedby": "link-hint" });
  #button = element("button", { type: "button", onclick: () => this.#add() }, "Add link");
  #hint = element("p", { class: "hint", id: "link-hint" });
  #row = element("div", { class: "row" }, this.#label, this.#select, this.#button);

  constructor(store) {
    this.#store = store;
    this.element.append(this.#row, this.#hint);
  }

  /** Show what vehicle k can be linked to: those that come within reach, nearest first. */
  show(k) {
    this.#k = k;
    const { scenario } = this.#store;
    const all = vehiclesOf(scenario);
    const one = all[k];
    const { links } = scenario.formation;
    const near = all.filter((other, j) => j !== k && inReach(one, other));
    const linked = (other) => !links || links.some((pair) => pair.includes(one.name) && pair.includes(other.name));
    const open = near.filter((other) => !linked(other)).sort((a, b) => gapBetween(one, a) - gapBetween(one, b));
    this.#offer(open.map((other) => [other.name, `${other.name}, ${shown(gapBetween(one, other), "m")}`]));
    this.#row.hidden = !open.length;
    this.#hint.textContent = hintOf(one.name, { open, near, listed: Boolean(links) });
  }

  /** Fill the choice, and keep what is chosen where it is still there. */
  #offer(options) {
    const { value } = this.#select;
    const known = JSON.stringify(options);
    if (this.#select.dataset.known === known) return;
    this.#select.dataset.known = known;
    this.#select.replaceChildren(...options.map(([name, text]) => element("option", { value: name }, text)));
    if (options.some(([name]) => name === value)) this.#select.value = value;
  }

  #add() {
    const { scenario } = this.#store;
    const pair = [vehiclesOf(scenario)[this.#k].name, this.#select.value];
    const last = this.#select.options.length === 1;
    this.#store.edit(withLinks(scenario, [...scenario.formation.links, pair]));
    notice(`Link ${pair.join("-")} added. Under “Links” it can be removed again.`);
    // the row goes with the last link that it offers
    if (last) byId("chosen").focus();
  }
}

function hintOf(name, { open, near, listed }) {
  if (!near.length) return `No other circle comes within reach of ${name}: bring it nearer, or raise the range.`;
  if (!listed) return `Links follow reach: ${name} is linked to ${near.map((one) => one.name).join(", ")}.`;
  return open.length ? "In m: how near the two circles come." : `${name} is linked to every vehicle within its reach.`;
}
