// What can be asked of a flight: its form.

import { element } from "./elements.js";
import { choice, labelled, number, RequestForm, SERIES_LIMIT, wide } from "./requests.js";
import { GUIDANCES } from "./tables.js";

const SEED = 1;
/** What each guidance is called here; the others by their names. */
const STEERING = { track: "keep to the plan", mpc: "look ahead, keep apart", none: "open loop" };

/** The form of a flight; `size()` returns the number of vehicles. */
export function flightForm(size, handIn) {
  const trials = number("fly-trials", 50);
  const guidance = choice("fly-guidance", Object.fromEntries(Object.keys(GUIDANCES).map((name) => [name, STEERING[name] ?? name])));
  const wind = text("fly-wind", "scenario’s");
  const lose = text("fly-lose", "v3@60, L1@90");
  const hold = text("fly-hold", "v2@100:20");
  const read = () => ({
    trials: trials.valueAsNumber,
    seed: SEED,
    guidance: guidance.value,
    lose: listed(lose.value),
    hold: listed(hold.value),
    // what is no number is for the service to refuse
    ...(wind.value.trim() ? { wind_mps: listed(wind.value).map(Number) } : {}),
    series: size() <= SERIES_LIMIT,
  });
  const explained = element("p", { class: "hint" }, GUIDANCES[guidance.value]);
  guidance.addEventListener("change", () => (explained.textContent = GUIDANCES[guidance.value]));
  return new RequestForm(
    "flight",
    "Fly",
    "Fly the plan many times: vehicles steer by their own estimates, in wind, with losses.",
    {
      fields: { trials, guidance, wind_mps: wind, lose, hold },
      read,
      rows: [
        labelled("Flights", trials),
        wide("Steering", guidance),
        explained,
        labelled("Wind x, y (m/s)", wind),
        wide("Lost on the way", lose),
        wide("Held on the way", hold),
        element("p", { class: "hint" }, "v3@60: at 60 s; v2@100:20: from 100 s on, for 20 s. Also landmarks, and sensors as sensor:v3@60."),
      ],
      handIn,
    },
  );
}

/** What a text lists, between commas or spaces. */
export function listed(text) {
  return text.split(/[\s,;]+/).filter(Boolean);
}

function text(id, example) {
  return element("input", { id, type: "text", placeholder: example, autocomplete: "off", spellcheck: "false", "aria-describedby": `${id}-fault` });
}
