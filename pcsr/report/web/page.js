"use strict";
// Draws the charts and one example at a time: a browser grants about 16 WebGL contexts, and each view takes one.
(() => {
  const drawn = JSON.parse(document.getElementById("drawn").textContent);
  const row = document.querySelector("#examples .row");
  const buttons = [...document.querySelectorAll("[data-example]")];
  const home = { eye: { x: 1, y: 1, z: 0.7 }, up: { x: 0, y: 0, z: 1 }, center: { x: 0, y: 0, z: 0 } };
  const config = { displayModeBar: false, responsive: true };
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const copy = (value) => JSON.parse(JSON.stringify(value));
  let current = 0;
  let camera = home;
  let views = [];

  function themed(trace) {
    const named = typeof trace.marker.color === "string" && !trace.marker.color.startsWith("#");
    return named ? { ...trace, marker: { ...trace.marker, color: colour(trace.marker.color) } } : trace;
  }

  function sceneLayout(range) {
    const axis = (k) => ({ visible: false, range: range[k], autorange: false });
    return {
      margin: { l: 0, r: 0, t: 0, b: 0 },
      showlegend: false,
      paper_bgcolor: "rgba(0,0,0,0)",
      scene: {
        aspectmode: "cube", dragmode: "orbit", camera: copy(camera),
        xaxis: axis(0), yaxis: axis(1), zaxis: axis(2),
      },
    };
  }

  // Only the view that was last touched leads: turning the others makes the same events, which must go no further.
  let leader = null;
  let followed = null;
  let turning = false;
  function follow(view, seen) {
    if (view !== leader || !seen) return;
    camera = copy(seen);
    if (!turning) turn();
  }

  async function turn() {
    turning = true;
    while (followed !== camera) {
      followed = camera;
      const others = views.filter((view) => view !== leader);
      await Promise.all(others.map((view) => Plotly.relayout(view, { "scene.camera": copy(camera) })));
      await new Promise(requestAnimationFrame);
    }
    turning = false;
  }

  function link(view) {
    const moved = (event) => follow(view, event["scene.camera"]);
    view.on("plotly_relayouting", moved);
    view.on("plotly_relayout", moved);
    view.addEventListener("pointerdown", () => { leader = view; }, true);
    view.addEventListener("wheel", () => {
      leader = view;
      // plotly tells of a zoom before the camera has moved, and then not again.
      const ask = () => follow(view, view._fullLayout.scene._scene?.getCamera());
      [50, 200, 600].forEach((wait) => setTimeout(ask, wait));
    }, true);
    view.addEventListener("dblclick", () => {
      leader = null;
      camera = copy(home);
      if (!turning) turn();
    });
  }

  function element(name, className, parent) {
    const child = document.createElement(name);
    child.className = className;
    return parent.appendChild(child);
  }

  async function show(k) {
    current = k;
    const example = drawn.examples[k];
    buttons.forEach((button, i) => button.setAttribute("aria-pressed", String(i === k)));
    const limit = document.getElementById("limit");
    if (limit) limit.textContent = `${example.limit.toPrecision(3)} ×10⁻³`;
    while (views.length < example.views.length) {
      const figure = element("figure", "", row);
      const view = element("div", "view", figure);
      element("figcaption", "", figure);
      views.push(view);
    }
    const plots = [];
    example.views.forEach((shown, i) => {
      const view = views[i];
      view.nextSibling.textContent = shown.title;
      plots.push(Plotly.react(view, shown.traces.map(themed), sceneLayout(shown.range ?? example.range), config));
    });
    await Promise.all(plots);
    views.filter((view) => !view.dataset.linked).forEach((view) => {
      view.dataset.linked = "yes";
      link(view);
    });
  }

  function chart(container) {
    const { data, layout } = drawn.charts[container.dataset.chart];
    const axis = { gridcolor: colour("line"), zerolinecolor: colour("line"), linecolor: colour("line") };
    const legend = { orientation: "h", y: 1, yanchor: "bottom", x: 0 };
    container.style.height = `${layout.height}px`;
    Plotly.react(container, data, {
      margin: { l: 60, r: 10, t: 40, b: 50 },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: { color: colour("ink"), family: "system-ui, sans-serif" },
      ...copy(layout),
      legend: { ...legend, ...layout.legend },
      xaxis: { ...axis, ...layout.xaxis },
      yaxis: { ...axis, automargin: true, ...layout.yaxis },
    }, config);
  }

  function draw() {
    document.querySelectorAll("[data-chart]").forEach(chart);
    if (row) show(current);
  }

  buttons.forEach((button, k) => button.addEventListener("click", () => show(k)));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  draw();
})();
