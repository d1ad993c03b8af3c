// The pairs to synchronise: listed ones to take out, or those that follow reach.

import { alert, button, element, folded } from "./elements.js";
import { linksPresent, withLinks, withoutLink } from "./scenario.js";

const PLACE = /^formation\.links(?:\[(\d+)\])?/;
const LISTED = "Only these pairs are synchronised. The tool “Link” adds and removes them on the map. A link out of reach stops the plan until it is taken out.";

/** The part of the form for the links of a store's scenario, folded until one of them is at fault.
 *
 * Returns the element to put in the form, what shows the links, and what shows the faults of links.
 */
export function linksPart(store) {
  const said = element("p", { class: "hint" });
  const list = element("ul", { class: "chips", "aria-label": "Links" });
  const fault = alert();
  const all = button("", () => change(listed() ? undefined : present()));
  const group = folded("Links", said, list, fault, all);
  group.className = "links";
  /** @type {any} */
  let known = null;
  /** @type {any[]} */
  let chips = [];
  return { group, show, showFaults };

  /** Show the links of the scenario, unless they are on show already. */
  function show() {
    const count = listed() ? 0 : present().length;
    said.textContent = listed() ? LISTED : `Every two vehicles whose circles come within reach are linked, ${count === 1 ? "1 link" : `${count} links`} just now.`;
    const { links } = store.scenario.formation;
    if (JSON.stringify(links) === known) return;
    known = JSON.stringify(links);
    all.textContent = listed() ? "Let links follow reach" : "List them";
    chips = (links || []).map((pair, k) => chip(pair.join("-"), k));
    list.replaceChildren(...chips.map((one) => one.item));
    list.hidden = !chips.length;
    fault.textContent = "";
  }

  /** Show what is wrong with links, each at its place; returns the faults of anything else. */
  function showFaults(faults) {
    const messages = new Map();
    const others = [];
    for (const one of faults) {
      const found = PLACE.exec(one.path || "");
      if (found) messages.set(chips[found[1]], one.message);
      else others.push(one);
    }
    for (const one of chips) put(one, messages.get(one) || "");
    fault.textContent = messages.get(undefined) || "";
    if (messages.size) group.open = true;
    return others;
  }

  function listed() {
    return Array.isArray(store.scenario.formation.links);
  }

  function present() {
    return linksPresent(store.scenario, store.plan);
  }

  function chip(name, k) {
    const label = `Remove ${name}`;
    const wrong = element("p", { class: "fault" });
    const sign = [element("span", { class: "sign", "aria-hidden": "true" }, "×"), element("span", { class: "words" }, label)];
    const remover = button(sign, () => remove(k), { "aria-label": label, title: label });
    return { item: element("li", {}, element("span", {}, name), remover, wrong), remover, wrong };
  }

  function remove(k) {
    store.edit(withoutLink(store.scenario, k));
    (chips[k] || chips.at(-1))?.remover.focus();
    if (!chips.length) all.focus();
  }

  function change(links) {
    store.edit(withLinks(store.scenario, links));
    all.focus();
  }
}

function put({ item, wrong }, text) {
  if (wrong.textContent === text) return;
  wrong.textContent = text;
  item.classList.toggle("bad", text !== "");
  if (text) wrong.setAttribute("role", "alert");
  else wrong.removeAttribute("role");
}
