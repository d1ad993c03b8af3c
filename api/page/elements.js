// Elements made without markup: what users name things never becomes HTML.

/** Return an element: element("p", {class: "hint", onclick: f}, "text", child, ...).
 * @param {string} name
 * @param {Record<string, any>} attributes
 * @param {...(Node | string | null | undefined)} children
 * @returns {any} */
export function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value === true) made.setAttribute(key, "");
    else made.setAttribute(key, value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

/** Return the element of an identifier, which index.html or a panel has made.
 * @param {string} id
 * @returns {any} */
export function byId(id) {
  return document.getElementById(id);
}

/** Return a number as people read it: four digits, no exponent where that can be. */
export function shown(value, unit = "") {
  if (value === null || value === undefined) return "—";
  const text = Number(value.toPrecision(4)).toString();
  return unit ? `${text} ${unit}` : text;
}

/** Show a message over the page, wherever it is scrolled to; an empty text clears it. */
export function notice(text, { fault = false } = {}) {
  const line = byId("notice");
  line.textContent = text;
  line.classList.toggle("bad", fault);
  byId("dismiss").hidden = text === "";
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

/** Show what is wrong with an input next to it, in the element of its id and "-fault". */
export function mark(input, text) {
  const place = byId(`${input.id}-fault`);
  if (place.textContent === text) return;
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
  const link = element("a", { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
