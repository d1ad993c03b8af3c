// Draws the figures of a page from the values that stand in it, in the colours of the scheme chosen.
"use strict";
(() => {
  const read = (id) => JSON.parse(document.getElementById(id).textContent);
  const settings = read("plot-settings");
  const dark = () => document.body.dataset.mdColorScheme === "slate";

  function swapped(values) {
    let text = JSON.stringify(values);
    if (dark()) {
      for (const [light, other] of Object.entries(settings.dark)) {
        text = text.replaceAll('"' + light + '"', '"' + other + '"');
      }
    }
    return JSON.parse(text);
  }

  function draw(div) {
    const spec = swapped(read(div.id + "-values"));
    const slider = div.parentElement.querySelector(".player input");
    if (slider) {
      // the page has its own controls, which take the keyboard
      delete spec.layout.updatemenus;
      delete spec.layout.sliders;
      spec.layout.height -= spec.layout.meta.controls_px;
      spec.layout.margin.b -= spec.layout.meta.controls_px;
      const frame = spec.frames[Number(slider.value)];
      frame.traces.forEach((n, i) => { Object.assign(spec.data[n], frame.data[i]); });
    }
    Plotly.react(div, spec.data, spec.layout, settings.config);
  }

  function player(div) {
    const spec = read(div.id + "-values");
    if (!spec.frames) { return; }
    const bar = document.createElement("div");
    const button = document.createElement("button");
    const slider = document.createElement("input");
    const output = document.createElement("output");
    bar.className = "player";
    button.type = "button";
    button.textContent = "Play";
    slider.type = "range";
    slider.min = 0;
    slider.max = spec.frames.length - 1;
    slider.value = 0;
    slider.setAttribute("aria-label", "Time within the period");
    bar.append(button, slider, output);
    div.before(bar);
    let timer = 0;
    const times = spec.layout.sliders[0].steps.map((step) => step.label);
    const show = () => {
      output.textContent = times[slider.value] + " s";
      draw(div);
    };
    const stop = () => {
      clearInterval(timer);
      timer = 0;
      button.textContent = "Play";
    };
    const step = () => {
      slider.value = (Number(slider.value) + 1) % spec.frames.length;
      show();
    };
    button.addEventListener("click", () => {
      if (timer) { stop(); return; }
      timer = setInterval(step, 100);
      button.textContent = "Pause";
    });
    slider.addEventListener("input", () => { stop(); show(); });
    output.textContent = times[0] + " s";
  }

  const plots = [...document.querySelectorAll(".plot")];
  for (const div of plots) {
    player(div);
    draw(div);
  }
  new MutationObserver(() => plots.forEach(draw)).observe(document.body, {
    attributeFilter: ["data-md-color-scheme"],
  });
})();
