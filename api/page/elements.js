// Elements made without markup: what users name things never becomes HTML.

import { rounded } from "./scenario.js";

/** Return an element: element("p", {class: "hint", onclick: f}, "text", child, ...); lists of children are
 * taken apart, and what is falsy is left out. The name of one of a drawing begins with "svg:".
 * @param {string} name
 * @param {Record<string, any>} attributes
 * @param {...any} children
 * @returns {any} */
export function element(name, attributes = {}, ...children) {
  const made = name.startsWith("svg:") ? document.createElementNS("http://www.w3.org/2000/svg", name.slice(4)) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else made.setAttribute(key, value === true ? "" : value);
  }
  made.append(...present(children));
  return made;
}

/** Return what there is of some children, in one list. */
export function present(children) {
  return children.flat(Infinity).filter(Boolean);
}

/** Give a place other children; those that it has already stay, with the focus and what is open in them.
 * @param {Element} place
 * @param {Node[]} children */
export function renew(place, children) {
  let next = place.firstChild;
  for (const child of children) {
    let same = next;
    while (same && !unopened(same).isEqualNode(child)) same = same.nextSibling;
    if (!same) place.insertBefore(child, next);
    while (same && next !== same) next = removed(/** @type {ChildNode} */ (next));
    if (same) next = same.nextSibling;
  }
  while (next) next = removed(next);
}

function removed(node) {
  const next = node.nextSibling;
  node.remove();
  return next;
}

/** A copy as the node was before something was opened in it. */
function unopened(node) {
  const copy = element("div", {}, node.cloneNode(true));
  for (const note of copy.querySelectorAll("[popover]")) note.remove();
  for (const opener of copy.querySelectorAll("[popovertarget], [open]")) for (const mark of ["popovertarget", "open"]) opener.removeAttribute(mark);
  return copy.firstChild;
}

/** Return a button. */
export function button(text, onclick, attributes = {}) {
  return element("button", { type: "button", onclick, ...attributes }, text);
}

/** Return the place for a fault, read out as it comes. */
export function alert(id) {
  return element("p", { class: "fault", role: "alert", id });
}

/** Return what is folded below a summary. */
export function folded(summary, ...children) {
  return element("details", {}, element("summary", {}, summary), ...children);
}

/** Return a table of rows below the heads of their columns; the first cell of a row is its head. */
export function table(heads, rows, ...rest) {
  const row = ([first, ...others]) => element("tr", {}, element("th", { scope: "row" }, first), others.map((one) => element("td", {}, one)));
  const top = element("tr", {}, heads.map((text) => (text === "" ? element("td") : element("th", { scope: "col" }, text))));
  return element("table", { class: "losses" }, ...rest, element("thead", {}, top), element("tbody", {}, rows.map(row)));
}

/** Return the options of a choice, `{ value: text }`. */
export function options(texts) {
  return Object.entries(texts).map(([value, text]) => element("option", { value }, text));
}

/** Show a dialogue, which is gone once it is closed; its heading has the identifier `about` and "-title". */
export function dialogue(about, title, attributes, ...children) {
  const id = `${about}-title`;
  const close = button("×", () => made.close(), { class: "small", "aria-label": "Close" });
  const gone = () => {
    made.remove();
    // what opened it may be in a menu that is closed
    if (document.activeElement === document.body) byId("menu").focus();
  };
  const head = element("div", { class: "title-row" }, element("h2", { id }, title), close);
  const made = element("dialog", { "aria-labelledby": id, onclose: gone, ...attributes }, head, ...children);
  document.body.append(made);
  made.showModal();
  // not on the way out
  /** @type {any} */ (made.querySelector("input:not([type=file]), select, [role=tab]"))?.focus();
  return made;
}

/** A line over the map with a button that ends what it tells of; returns `{ say(text), hide() }`, of which the last
 * returns whether it was there. */
export function chip(title, end) {
  const words = element("span", { role: "status" });
  const ending = button(title, end, { class: "small" });
  const line = element("div", { class: "comparison" }, words, ending);
  const say = (text) => {
    words.textContent = text;
    if (line.isConnected) return;
    byId("map").append(line);
    ending.focus();
  };
  const hide = () => {
    const shown = line.isConnected;
    if (line.contains(document.activeElement)) byId("menu").focus();
    line.remove();
    return shown;
  };
  return { say, hide };
}

/** Call `take` with each file or value that is chosen in an input, which is ready for the next one. */
export function onceChosen(input, take) {
  input.addEventListener("change", () => {
    const chosen = input.files ? input.files[0] : input.value;
    input.value = "";
    if (chosen) take(chosen);
  });
  return input;
}

/** Call `take` with the first of the files that are dropped on a place. */
export function takeDropped(place, take) {
  for (const name of ["dragover", "drop"]) {
    place.addEventListener(name, (event) => {
      if (!event.dataTransfer.types.includes("Files")) return;
      event.preventDefault();
      if (name === "drop") take(event.dataTransfer.files[0]);
    });
  }
}

/** Return the element of an identifier, which index.html or a panel has made.
 * @param {string} id
 * @returns {any} */
export function byId(id) {
  return document.getElementById(id);
}

/** Return a number as people read it: so many digits, all of those before the point, no exponent where that can be. */
export function shown(value, unit = "", digits = 3) {
  if (value === null || value === undefined) return "—";
  const whole = Math.trunc(Math.abs(value)).toString().length;
  // what is under a tenth of a millimetre is a rounding error
  const text = rounded(unit === "m" ? Math.round(1e4 * value) / 1e4 : value, Math.max(digits, whole)).toString();
  return unit ? `${text} ${unit}` : text;
}

/** Return an angle or a rate again in degrees, as it is said beside one in radians; nothing of other quantities. */
export function degreesBeside(value, unit = "") {
  return value && unit.startsWith("rad") ? ` = ${shown((value * 180) / Math.PI)}${unit.replace("rad", "°")}` : "";
}

/** Return date and time of an RFC 3339 text, or of a time in ms. */
export function timeOf(time) {
  return new Date(time).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" });
}

/** How long a message is shown that asks for nothing. */
const MESSAGE_MS = 4000;
let passing = 0;

/** Show a message over the page, wherever it is scrolled to; an empty text clears it. It goes by itself, unless it `asks`
 * for something, as faults do. */
export function notice(text, { fault = false, asks = fault } = {}) {
  const line = byId("notice");
  line.textContent = text;
  line.classList.toggle("bad", fault);
  byId("dismiss").hidden = text === "" || !asks;
  clearTimeout(passing);
  if (text && !asks) passing = setTimeout(notice, MESSAGE_MS, "");
}

/** Whether the message on show says what is wrong. */
export function noticeIsFault() {
  return byId("notice").classList.contains("bad");
}

let waiting = 0;

/** Count what there is to wait for. */
export function busy(flag) {
  waiting += flag ? 1 : -1;
  byId("workspace").setAttribute("aria-busy", waiting > 0);
}

/** Do something that may fail, and say so. */
export async function attempt(task) {
  notice("");
  busy(true);
  try {
    await task();
  } catch (error) {
    // that a key is wanted is no fault; the form for it is there
    notice(error.message, { fault: error.status !== 401 });
  } finally {
    busy(false);
  }
}

/** Do something that may fail, and say so in an element: in the words of `wordsOf(error)`. */
export async function attemptAt(place, task, wordsOf = (error) => error.message) {
  place.textContent = "";
  try {
    await task();
  } catch (error) {
    place.textContent = wordsOf(error);
  }
}

/** Show what is wrong with an input in its row, in an element of its id and "-fault", which is made when first needed. */
export function mark(input, text) {
  const id = `${input.id}-fault`;
  const place = byId(id) ?? element("p", { class: "fault", id });
  if (place.textContent === text) return;
  const row = input.closest(".field, .row");
  if (!place.isConnected) row[row.matches(".field") ? "append" : "after"](place);
  const others = (input.getAttribute("aria-describedby") ?? "").split(" ").filter((other) => other && other !== id);
  input.setAttribute("aria-describedby", [id, ...others].join(" "));
  place.textContent = text;
  if (text) {
    input.setAttribute("aria-invalid", "true");
    place.setAttribute("role", "alert");
    input.closest("details")?.setAttribute("open", "");
  } else {
    input.removeAttribute("aria-invalid");
    place.removeAttribute("role");
  }
}

/** Offer a file for saving. */
export function save(content, name, type) {
  const url = URL.createObjectURL(new Blob([content], { type }));
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
