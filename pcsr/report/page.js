"use strict";
// Draws what the page's data block holds. One example at a time: a browser allows few 3-D contexts at once.
const data = JSON.parse(document.getElementById("data").textContent);
const ink = getComputedStyle(document.documentElement).getPropertyValue("--ink").trim();
const plain = { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: ink } };
const config = { responsive: true, displaylogo: false };
const colours = { input: "#8c959f", touch: "#cf222e", truth: "#57606a" };
const start = { eye: { x: 1.2, y: -1.3, z: 0.9 } };

function trace(cloud, scene, top, bar) {
  const marker = { size: cloud.role === "input" ? 2.6 : 1.5, color: colours[cloud.role] };
  if (cloud.error) {
    Object.assign(marker, { color: cloud.error, colorscale: "Viridis", cmin: 0, cmax: top, showscale: bar,
      colorbar: { title: { text: "error ×10⁻³" }, thickness: 12, len: 0.8 } });
  }
  return { type: "scatter3d", mode: "markers", x: cloud.x, y: cloud.y, z: cloud.z, marker, scene, hoverinfo: "skip",
    showlegend: false };
}

function draw(example) {
  const errors = example.views.flatMap((view) => view.clouds.flatMap((cloud) => cloud.error || []));
  const top = errors.sort((a, b) => a - b)[Math.floor(0.98 * errors.length)] || 1;
  const layout = { ...plain, margin: { l: 0, r: 0, t: 30, b: 0 }, annotations: [] };
  const traces = [];
  const count = example.views.length;
  example.views.forEach((view, i) => {
    const scene = i ? "scene" + (i + 1) : "scene";
    const hidden = { visible: false };
    layout[scene] = { domain: { x: [i / count, (i + 1) / count - 0.005], y: [0, 1] }, aspectmode: "data", camera: start,
      xaxis: hidden, yaxis: hidden, zaxis: hidden };
    layout.annotations.push({ text: view.title.replace(/</g, "&lt;"), showarrow: false, xref: "paper", yref: "paper",
      x: (i + 0.5) / count, y: 1.02, xanchor: "center", yanchor: "bottom" });
    view.clouds.forEach((cloud) => traces.push(trace(cloud, scene, top, i === 1)));
  });
  const box = document.getElementById("views");
  Plotly.react(box, traces, layout, config).then(() => link(box, count));
}

// Turning one view turns all. Setting a camera raises the same event again, hence the guard.
function link(box, count) {
  box.removeAllListeners("plotly_relayouting");
  box.removeAllListeners("plotly_relayout");
  let busy = false;
  const follow = (change) => {
    const key = Object.keys(change).find((name) => /^scene\d*\.camera$/.test(name));
    if (busy || !key) return;
    busy = true;
    const update = {};
    for (let i = 0; i < count; i++) update[(i ? "scene" + (i + 1) : "scene") + ".camera"] = change[key];
    Plotly.relayout(box, update).then(() => { busy = false; });
  };
  box.on("plotly_relayouting", follow);
  box.on("plotly_relayout", follow);
}

const picker = document.getElementById("picker");
data.examples.forEach((example, i) => picker.add(new Option(example.name, i)));
picker.addEventListener("change", () => draw(data.examples[picker.value]));
if (data.examples.length) draw(data.examples[0]);

const bars = data.groups.methods.map((name, i) => (
  { type: "bar", name, x: data.groups.names, y: data.groups.values[i] }));
Plotly.newPlot("groups", bars, { ...plain, barmode: "group", margin: { t: 10 }, yaxis: { title: { text: data.groups.metric } } }, config);
if (data.curve.length) {
  Plotly.newPlot("curve", data.curve, { ...plain, margin: { t: 10 }, xaxis: { title: { text: "step" } },
    yaxis: { type: "log", title: { text: "loss; validation cd" } } }, config);
}
