// The first visit in this browser: what this is, an example that moves, and one button.

import { button, byId, element } from "./elements.js";
import { remember } from "./session.js";

/** Greet until the first edit, open or click anywhere; the example on show moves for one period. */
export function welcome(store, player) {
  const end = () => {
    if (card.isConnected) remember();
    card.remove();
  };
  const card = element(
    "section",
    { class: "card welcome", "aria-label": "Welcome" },
    element("p", {}, "syncplan plans circles on which robots meet at the right moments, so that all of them know where they are."),
    button("Plan your own team …", () => byId("new").click(), { class: "primary" }),
  );
  // what was opened before is the example on show: only what comes is an end
  for (const name of ["opened", "scenario"]) store.addEventListener(name, end);
  document.addEventListener("click", end, { once: true });
  byId("map").append(card);
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches) player.play({ once: true });
}
