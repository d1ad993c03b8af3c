// Tabs as the ARIA practices have them: arrow keys go round, one tab is in the order of Tab.

import { element } from "./elements.js";

/** Fill a tab list; `chosen(name)` is called when one is chosen, and `panelOf(name)` returns the id of what it shows.
 *
 * Returns {show(names), choose(name), current()}.
 */
export function tabs(list, titles, chosen, panelOf = (_name) => "panel") {
  /** @type {any} */
  let current = null;
  const buttons = new Map();
  for (const [name, title] of Object.entries(titles)) {
    const button = element(
      "button",
      { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": panelOf(name), tabindex: "-1", hidden: true },
      title,
    );
    button.addEventListener("click", () => choose(name));
    buttons.set(name, button);
    list.append(button);
  }
  list.addEventListener("keydown", (event) => {
    const seen = [...buttons].filter(([, button]) => !button.hidden).map(([name]) => name);
    const at = seen.indexOf(current);
    const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: seen.length - 1 }[event.key];
    if (to === undefined || !seen.length) return;
    event.preventDefault();
    const name = seen[(to + seen.length) % seen.length];
    choose(name);
    buttons.get(name).focus();
  });

  function choose(name) {
    current = name;
    for (const [other, button] of buttons) {
      button.setAttribute("aria-selected", other === name);
      button.tabIndex = other === name ? 0 : -1;
    }
    chosen(name);
  }

  function show(names) {
    for (const [name, button] of buttons) button.hidden = !names.includes(name);
    if (names.length && !names.includes(current)) choose(names[0]);
  }

  return { show, choose, current: () => current };
}
