// The pairs to synchronise: listed ones to take out, or those that follow reach.

import { element } from "./elements.js";
import { linksPresent, withLinks, withoutLink } from "./scenario.js";

const PLACE = /^formation\.links(?:\[(\d+)\])?/;

/** The part of the form for the links of a store's scenario, folded until one of them is at fault. */
export class Links {
  /** the element to put in the form */
  group = element("details", { class: "links" });
  #store;
  /** @type {any} */
  #known = null;
  #chips = [];
  #all = element("button", { type: "button", onclick: () => this.#change(this.#listed ? undefined : this.#present) });
  #said = element("p", { class: "hint" });
  #list = element("ul", { class: "chips", "aria-label": "Links" });
  #fault = element("p", { class: "fault", role: "alert" });

  constructor(store) {
    this.#store = store;
    this.group.append(element("summary", {}, "Links"), this.#said, this.#list, this.#fault, this.#all);
  }

  /** Show the links of the scenario, unless they are on show already. */
  show() {
    const { formation } = this.#store.scenario;
    this.#say();
    const known = JSON.stringify(formation.links);
    if (known === this.#known) return;
    this.#known = known;
    this.#all.textContent = this.#listed ? "Let links follow reach" : "List them";
    this.#chips = (formation.links || []).map((pair, k) => this.#chip(pair.join("-"), k));
    this.#list.replaceChildren(...this.#chips.map((one) => one.item));
    this.#list.hidden = !this.#chips.length;
    this.#fault.textContent = "";
  }

  /** Show what is wrong with links, each at its place; returns the faults of anything else. */
  showFaults(faults) {
    const messages = new Map();
    const others = [];
    for (const fault of faults) {
      const found = PLACE.exec(fault.path || "");
      if (found) messages.set(this.#chips[found[1]], fault.message);
      else others.push(fault);
    }
    for (const chip of this.#chips) put(chip.item, chip.fault, messages.get(chip) || "");
    this.#fault.textContent = messages.get(undefined) || "";
    if (messages.size) this.group.open = true;
    return others;
  }

  #say() {
    this.#said.textContent = this.#listed
      ? "Only these pairs are synchronised. The tool “Link” adds and removes them on the map. A link out of reach stops the plan until it is taken out."
      : `Every two vehicles whose circles come within reach are linked, ${count(this.#present.length)} just now.`;
  }

  get #listed() {
    return Array.isArray(this.#store.scenario.formation.links);
  }

  get #present() {
    return linksPresent(this.#store.scenario, this.#store.plan);
  }

  #chip(name, k) {
    const fault = element("p", { class: "fault" });
    const label = `Remove ${name}`;
    const button = element("button", { type: "button", "aria-label": label, title: label, onclick: () => this.#remove(k) });
    button.append(element("span", { class: "sign", "aria-hidden": "true" }, "×"), element("span", { class: "words" }, label));
    return { item: element("li", {}, element("span", {}, name), button, fault), button, fault };
  }

  #remove(k) {
    this.#store.edit(withoutLink(this.#store.scenario, k));
    (this.#chips[k] || this.#chips.at(-1))?.button.focus();
    if (!this.#chips.length) this.#all.focus();
  }

  #change(links) {
    this.#store.edit(withLinks(this.#store.scenario, links));
    this.#all.focus();
  }
}

function put(item, fault, text) {
  if (fault.textContent === text) return;
  fault.textContent = text;
  item.classList.toggle("bad", text !== "");
  if (text) fault.setAttribute("role", "alert");
  else fault.removeAttribute("role");
}

function count(links) {
  return links === 1 ? "1 link" : `${links} links`;
}
