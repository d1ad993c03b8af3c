"use strict";
const read = (id) => document.getElementById(id).textContent;
const darkColors = JSON.parse(read("dark-colors"));
const darkScheme = matchMedia("(prefers-color-scheme: dark)");
const chosen = document.documentElement.dataset.theme;
const isDark = () => (chosen ? chosen === "dark" : darkScheme.matches);
const config = JSON.parse(read("plotly-config"));
// px of a figure's frame below which it has the layout of a sheet, or of a column
const widths = { sheet: 880, column: 600 };
const printed = { width: 700, height: 940 };
// smallest scale at which a further figure goes on the same sheet
const leastScale = 0.6;
const layoutOf = (div) => ["column", "sheet"].find((one) => div.clientWidth < widths[one]) ?? "";

function parsed(id, dark) {
  let text = read(id);
  if (dark) {
    for (const [light, other] of Object.entries(darkColors)) {
      text = text.replaceAll('"' + light + '"', '"' + other + '"');
    }
  }
  return JSON.parse(text);
}

function valuesOf(name, dark, layout) {
  const spec = parsed("values-" + name, dark);
  if (document.getElementById(layout + "-" + name)) {
    Object.assign(spec, parsed(layout + "-" + name, dark));
  }
  if (spec.frames) {
    // the page has its own controls, which take the keyboard
    delete spec.layout.updatemenus;
    delete spec.layout.sliders;
    spec.layout.height -= spec.layout.meta.controls_px;
    spec.layout.margin.b -= spec.layout.meta.controls_px;
  }
  return spec;
}

function draw(div, dark, width) {
  const spec = valuesOf(div.id.slice(5), dark, width ? "sheet" : layoutOf(div));
  if (width) {
    spec.layout.width = width;
  }
  Plotly.react(div, spec.data, spec.layout, config);
}

function player(div, spec) {
  let known = null;
  let dark = null;
  const times = spec.layout.sliders[0].steps.map((step) => step.label);
  const button = document.createElement("button");
  const slider = document.createElement("input");
  const output = document.createElement("output");
  const bar = document.createElement("div");
  bar.className = "player";
  bar.append(button, slider, output);
  div.before(bar);
  button.type = "button";
  slider.type = "range";
  slider.min = 0;
  slider.max = spec.frames.length - 1;
  slider.value = 0;
  slider.setAttribute("aria-label", "Time within the period");
  let playing = false;
  let timer = 0;
  const show = (wanted) => {
    const k = Number(slider.value);
    output.textContent = times[k] + " s";
    slider.setAttribute("aria-valuetext", times[k] + " seconds");
    if (dark !== wanted) {
      dark = wanted;
      known = valuesOf(div.id.slice(5), dark, "");
    }
    const frame = known.frames[k];
    const data = [...known.data];
    frame.traces.forEach((n, i) => { data[n] = { ...data[n], ...frame.data[i] }; });
    // the layout as it is keeps the reader's zoom
    Plotly.react(div, data, div.layout, config);
  };
  const step = () => {
    if (!playing) { return; }
    slider.value = (Number(slider.value) + 1) % spec.frames.length;
    show(isDark());
    timer = setTimeout(step, 100);
  };
  const label = () => { button.textContent = playing ? "Pause" : "Play"; };
  button.addEventListener("click", () => {
    clearTimeout(timer);
    playing = !playing;
    label();
    step();
  });
  slider.addEventListener("input", () => {
    playing = false;
    label();
    show(isDark());
  });
  label();
  output.textContent = times[0] + " s";
  return show;
}

const shown = new Map();
const plots = [...document.querySelectorAll(".plot")];
for (const div of plots) {
  draw(div, isDark());
  const spec = JSON.parse(read("values-" + div.id.slice(5)));
  if (spec.frames) { shown.set(div, player(div, spec)); }
}
function drawAll(dark, width) {
  for (const div of plots) {
    draw(div, dark, width);
    shown.get(div)?.(dark);
  }
}
darkScheme.addEventListener("change", () => drawAll(isDark()));
let layouts = plots.map(layoutOf).join();
addEventListener("resize", () => {
  const now = plots.map(layoutOf).join();
  if (now !== layouts) {
    layouts = now;
    drawAll(isDark());
  }
});

/** Share out the sections among sheets, each as full as their order allows. */
function paginate() {
  const header = document.querySelector("header").offsetHeight;
  let sheet = [];
  let filled = 0;
  let room = printed.height - header;
  const scale = () => Math.min(1, room / filled);
  for (const section of document.querySelectorAll("section")) {
    const height = section.offsetHeight;
    if (sheet.length && room / (filled + height) < leastScale) {
      sheet.at(-1).style.breakAfter = "page";
      [sheet, filled, room] = [[], 0, printed.height];
    }
    sheet.push(section);
    filled += height;
    for (const one of sheet) { one.style.zoom = scale(); }
  }
}

addEventListener("beforeprint", () => {
  document.documentElement.classList.add("printing");
  drawAll(false, printed.width);
  paginate();
});
addEventListener("afterprint", () => {
  document.documentElement.classList.remove("printing");
  for (const section of document.querySelectorAll("section")) { section.removeAttribute("style"); }
  drawAll(isDark());
});
