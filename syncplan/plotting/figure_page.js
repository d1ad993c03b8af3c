"use strict";
const read = (id) => document.getElementById(id).textContent;
const darkColors = JSON.parse(read("dark-colors"));
const darkScheme = matchMedia("(prefers-color-scheme: dark)");
const chosen = document.documentElement.dataset.theme;
const isDark = () => (chosen ? chosen === "dark" : darkScheme.matches);
const config = JSON.parse(read("plotly-config"));
const printWidth = 700;
const columnWidth = 600;
const isNarrow = (div) => div.clientWidth < columnWidth;

function parsed(id, dark) {
  let text = read(id);
  if (dark) {
    for (const [light, other] of Object.entries(darkColors)) {
      text = text.replaceAll('"' + light + '"', '"' + other + '"');
    }
  }
  return JSON.parse(text);
}

function valuesOf(name, dark, narrow) {
  const spec = parsed("values-" + name, dark);
  if (narrow && document.getElementById("column-" + name)) {
    Object.assign(spec, parsed("column-" + name, dark));
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
  const spec = valuesOf(div.id.slice(5), dark, !width && isNarrow(div));
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
  div.after(bar);
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
      known = valuesOf(div.id.slice(5), dark, false);
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
let narrow = plots.some(isNarrow);
addEventListener("resize", () => {
  if (plots.some(isNarrow) !== narrow) {
    narrow = !narrow;
    drawAll(isDark());
  }
});
addEventListener("beforeprint", () => drawAll(false, printWidth));
addEventListener("afterprint", () => drawAll(isDark()));
