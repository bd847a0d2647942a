"use strict";
// The episode browser: one flight, and another of the same episode beside it.
(function () {
  const { read, later, config, lander } = Report;
  const element = (id) => document.getElementById(id);
  const grounds = read("grounds-data"), opening = read("opening-data");
  const blue = "#0072B2", vermilion = "#D55E00", green = "#009E73", purple = "#CC79A7", orange = "#E69F00";
  const safeness = [[0, "#4d4d4d"], [1, "#e8e8e8"]];
  const flights = [...document.querySelectorAll("script.flight")].map((node) => ({
    policy: node.dataset.policy, episode: Number(node.dataset.episode), ending: node.dataset.ending,
    words: node.dataset.words, node,
  }));
  const policySelect = element("policy"), episodeSelect = element("episode"), besideSelect = element("beside"), look = element("look"), moment = element("moment");
  if (!flights.length) return;

  function bytes(text) { return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)); }
  function grid(rows, columns, value) {
    return Array.from({ length: rows }, (_, i) => Array.from({ length: columns }, (_, j) => value(i * columns + j)));
  }
  function axis(start, step, count) { return Array.from({ length: count }, (_, k) => start + (k + 0.5) * step); }
  function dataOf(flight) {
    if (!flight.data) flight.data = JSON.parse(flight.node.textContent);
    return flight.data;
  }
  function groundOf(episode) {
    const ground = grounds[episode];
    if (!ground.z) {
      const height = bytes(ground.height), hazard = bytes(ground.hazard), truth = bytes(ground.truth);
      const scale = (ground.high - ground.low) / 255;
      ground.z = grid(ground.cells, ground.cells, (k) => ground.low + scale * height[k]);
      ground.safe = grid(ground.cells, ground.cells, (k) => 1 - hazard[k] / 255);
      ground.truthMap = grid(ground.truth_cells, ground.truth_cells, (k) => (truth[k >> 3] >> (k & 7)) & 1);
    }
    return ground;
  }
  function lookMap(view) {
    const packed = bytes(view.map);
    return grid(view.pixels, view.pixels, (k) => ((packed[k >> 1] >> (4 * (k & 1))) & 15) / 15);
  }
  function square(view) {
    const [x, y] = view.target, half = view.width / 2;
    return { x: [x - half, x + half, x + half, x - half, x - half], y: [y - half, y - half, y + half, y + half, y - half] };
  }
  const font = { family: "system-ui, sans-serif", size: 13 };
  const webgl = (() => {
    try { const canvas = document.createElement("canvas"); return Boolean(canvas.getContext("webgl")); }
    catch (error) { return false; }
  })();

  // What the 3-D view holds, whatever the lander does in it: the ground, and the flights.
  function endsOf(flight) {
    const ground = groundOf(flight.episode), size = ground.cell * ground.cells, shown = [flight, ...(beside ? [beside] : [])].map(dataOf);
    const ends = (axis, low, high) => [Math.min(low, ...shown.flatMap((data) => data[axis])), Math.max(high, ...shown.flatMap((data) => data[axis]))];
    const [low, high] = ends("z", ground.low, ground.high);
    return [ends("x", ground.corner[0], ground.corner[0] + size), ends("y", ground.corner[1], ground.corner[1] + size), [low, high + 0.7 * lander.size]];
  }
  function drawSpace(flight) {
    const node = element("flight-space");
    if (!webgl) { node.textContent = "This browser has no WebGL, which the 3-D view needs."; return; }
    const data = dataOf(flight), ground = groundOf(flight.episode), plane = data.nominal[2];
    const traces = [{
      type: "surface", x: axis(ground.corner[0], ground.cell, ground.cells), y: axis(ground.corner[1], ground.cell, ground.cells),
      z: ground.z, surfacecolor: ground.safe, colorscale: safeness, cmin: 0, cmax: 1, showscale: false, hoverinfo: "skip",
    }];
    for (const view of data.looks) {
      const line = square(view);
      traces.push({ type: "scatter3d", mode: "lines", x: line.x, y: line.y, z: line.x.map(() => plane + 1), line: { color: orange, width: 3 }, hoverinfo: "skip", showlegend: false });
    }
    traces.push({
      type: "scatter3d", mode: "lines", x: data.x, y: data.y, z: data.z, line: { color: vermilion, width: 6 }, name: flight.policy,
      text: data.time.map((t, k) => t + " s, " + data.speed[k] + " m/s"), hovertemplate: "%{text}<br>%{z} m<extra></extra>",
    });
    if (beside) {
      const other = dataOf(beside), x = other.touchdown[0], y = other.touchdown[1];
      traces.push({ type: "scatter3d", mode: "lines", x: other.x, y: other.y, z: other.z, line: { color: green, width: 4 }, name: beside.policy, hoverinfo: "name" });
      traces.push({ type: "scatter3d", mode: "markers", x: [x], y: [y], z: [plane + 1], marker: { color: green, size: 6, symbol: "diamond" }, showlegend: false, hoverinfo: "skip" });
    }
    const sites = [data.nominal, ...data.decisions.map((decision) => [...decision.site, plane])];
    traces.push({ type: "scatter3d", mode: "lines+markers", x: sites.map((s) => s[0]), y: sites.map((s) => s[1]), z: sites.map(() => plane + 1), line: { color: blue, width: 2 }, marker: { color: blue, size: 3 }, name: "targets" });
    traces.push({ type: "scatter3d", mode: "markers", x: [data.touchdown[0]], y: [data.touchdown[1]], z: [plane + 1], marker: { color: purple, size: 7, symbol: "diamond" }, name: "touchdown" });
    const ends = endsOf(flight);
    traces.push(...lander.traces(data, Number(moment.value), ends));
    Plotly.react(node, traces, {
      margin: { l: 0, r: 0, t: 0, b: 0 }, font, legend: { orientation: "h", y: 0, yanchor: "top" }, uirevision: "space",
      scene: { aspectmode: "data", xaxis: { title: { text: "east [m]" }, range: ends[0] }, yaxis: { title: { text: "north [m]" }, range: ends[1] }, zaxis: { title: { text: "up [m]" }, range: ends[2] }, camera: { eye: { x: 1.3, y: -1.55, z: 0.55 }, center: { x: 0, y: 0, z: -0.12 } } },
    }, config);
  }

  // One moment in both pictures: the lander at a node, and the newest look there.
  function showMoment(k) {
    const data = dataOf(current), node = element("flight-space");
    moment.value = k;
    element("moment-text").textContent = lander.describe(data, k);
    if (webgl && node.dataset.shown) lander.move(node, data, k, endsOf(current));
  }
  function drawMap(flight) {
    const data = dataOf(flight), ground = groundOf(flight.episode), k = Number(look.value), view = data.looks[k];
    const pixel = view.width / view.pixels, half = view.width / 2;
    const traces = [
      { type: "heatmap", x: axis(ground.truth_corner[0], 1, ground.truth_cells), y: axis(ground.truth_corner[1], 1, ground.truth_cells), z: ground.truthMap, colorscale: safeness, zmin: 0, zmax: 1, showscale: false, hoverinfo: "skip" },
      { type: "heatmap", x: axis(view.target[0] - half, pixel, view.pixels), y: axis(view.target[1] - half, pixel, view.pixels), z: lookMap(view), colorscale: "Cividis", zmin: 0, zmax: 1, colorbar: { title: { text: "seen safe", side: "right" }, thickness: 12 }, hovertemplate: "%{x:.1f} m, %{y:.1f} m: %{z:.2f}<extra></extra>" },
    ];
    data.looks.forEach((other, index) => {
      const line = square(other);
      traces.push({ type: "scatter", mode: "lines", x: line.x, y: line.y, line: { color: orange, width: index === k ? 3 : 1 }, hoverinfo: "skip", showlegend: false });
    });
    const sites = [data.nominal, ...data.decisions.map((decision) => decision.site)];
    traces.push({ type: "scatter", mode: "lines", x: data.x, y: data.y, line: { color: vermilion, width: 2 }, name: flight.policy, hoverinfo: "skip" });
    if (beside) {
      const other = dataOf(beside);
      traces.push({ type: "scatter", mode: "lines", x: other.x, y: other.y, line: { color: green, width: 2, dash: "dash" }, name: beside.policy, hoverinfo: "skip" });
      traces.push({ type: "scatter", mode: "markers", x: [other.touchdown[0]], y: [other.touchdown[1]], marker: { color: green, size: 13, symbol: "star", line: { color: "#000", width: 1 } }, showlegend: false });
    }
    traces.push({ type: "scatter", mode: "lines+markers", x: sites.map((s) => s[0]), y: sites.map((s) => s[1]), line: { color: blue, width: 1 }, marker: { color: blue, size: 7 }, name: "targets" });
    traces.push({ type: "scatter", mode: "markers", x: [data.touchdown[0]], y: [data.touchdown[1]], marker: { color: purple, size: 15, symbol: "star", line: { color: "#000", width: 1 } }, name: "touchdown" });
    const [x, y] = data.looks[0].target, landed = [data, ...(beside ? [dataOf(beside)] : [])].map((each) => each.touchdown);
    const reach = Math.max(105, half * 1.05, ...landed.map((place) => 15 + Math.max(Math.abs(place[0] - x), Math.abs(place[1] - y))));
    Plotly.react(element("flight-map"), traces, {
      margin: { l: 56, r: 8, t: 8, b: 44 }, font, legend: { orientation: "h", y: -0.16 }, plot_bgcolor: "#777",
      xaxis: { title: { text: "east [m]" }, range: [x - reach, x + reach], showgrid: false, zeroline: false },
      yaxis: { title: { text: "north [m]" }, range: [y - reach, y + reach], showgrid: false, zeroline: false, scaleanchor: "x", constrain: "domain" },
    }, config);
    const decision = data.decisions[k];
    element("look-text").textContent = (k + 1) + " of " + data.looks.length + ", at " + view.time + " s, " + view.width.toFixed(0) + " m wide, " + decision.law + (decision.status === "nominal" ? "" : " (" + decision.status + ")");
  }

  function drawTime(flight) {
    const data = dataOf(flight), color = vermilion, end = data.time[data.time.length - 1];
    const line = (y, values, extra) => Object.assign({ type: "scatter", mode: "lines", x: data.time, y: values, yaxis: y, line: { color, width: 2 }, showlegend: false }, extra);
    const times = [...data.decisions.map((decision) => decision.time), end];
    const gain = (k) => { const values = data.decisions.map((decision) => decision.gains[k]); return [...values, values[values.length - 1]]; };
    const thrust = [...data.thrust, data.thrust[data.thrust.length - 1]];
    const traces = [
      line("y", data.z, { name: flight.policy, showlegend: Boolean(beside) }), line("y2", data.speed), line("y3", thrust, { line: { color, width: 2, shape: "hv" } }), line("y4", data.mass),
      line("y5", gain(0), { x: times, line: { color: blue, width: 2, shape: "hv" }, name: "gain on position", showlegend: true }),
      line("y5", gain(1), { x: times, line: { color: purple, width: 2, shape: "hv", dash: "dot" }, name: "gain on velocity", showlegend: true }),
    ];
    if (beside) {
      const other = dataOf(beside), held = [...other.thrust, other.thrust[other.thrust.length - 1]];
      const style = { color: green, width: 2, dash: "dash" };
      for (const [y, values, shape] of [["y", other.z, "linear"], ["y2", other.speed, "linear"], ["y3", held, "hv"], ["y4", other.mass, "linear"]]) {
        traces.push({ type: "scatter", mode: "lines", x: other.time, y: values, yaxis: y, line: Object.assign({ shape }, style), name: beside.policy, showlegend: y === "y" });
      }
    }
    const flown = [...new Set(data.decisions.map((decision) => decision.law))].join(", ");
    const panel = (title, from, to) => ({ title: { text: title }, domain: [from, to], zeroline: false, gridcolor: "#ddd", automargin: true });
    Plotly.react(element("flight-time"), traces, {
      margin: { l: 70, r: 16, t: 60, b: 60 }, font, height: 720, legend: { orientation: "h", y: 1.0, yanchor: "bottom", x: 0 },
      xaxis: { title: { text: "time [s]; lines: looks" }, zeroline: false, gridcolor: "#eee", anchor: "y5" },
      yaxis: panel("altitude [m]", 0.83, 1), yaxis2: panel("speed [m/s]", 0.62, 0.79), yaxis3: panel("thrust [N]", 0.42, 0.58),
      yaxis4: panel("mass [kg]", 0.22, 0.38), yaxis5: panel("gains (" + flown + ")", 0, 0.15),
      shapes: data.looks.map((view) => ({ type: "line", xref: "x", yref: "paper", x0: view.time, x1: view.time, y0: 0, y1: 1, line: { color: "#bbb", width: 1 }, layer: "below" })),
    }, config);
  }

  let current = null, beside = null;
  function show(flight, besidePolicy) {
    current = flight;
    const same = flights.filter((other) => other.episode === flight.episode && other !== flight);
    beside = same.find((other) => other.policy === besidePolicy) || null;
    besideSelect.replaceChildren(new Option("nothing", ""), ...same.map((other) => new Option(other.policy + " \u2013 " + other.ending, other.policy)));
    besideSelect.value = beside ? beside.policy : "";
    besideSelect.disabled = !same.length;
    element("words-beside").textContent = beside ? "Beside it: " + beside.words : "";
    policySelect.value = flight.policy;
    const own = flights.filter((other) => other.policy === flight.policy);
    episodeSelect.replaceChildren(...own.map((other) => new Option(other.episode + " \u2013 " + other.ending, other.episode)));
    episodeSelect.value = flight.episode;
    element("words").textContent = "Episode " + flight.episode + ": " + flight.words;
    look.max = dataOf(flight).looks.length - 1;
    look.value = 0;
    moment.max = dataOf(flight).time.length - 1;
    moment.value = 0;
    element("moment-text").textContent = lander.describe(dataOf(flight), 0);
    for (const [id, make] of [["flight-space", drawSpace], ["flight-map", drawMap], ["flight-time", drawTime]]) {
      const node = element(id);
      node.dataset.shown = "";
      later(node, () => { make(flight); node.dataset.shown = flight.policy + "/" + flight.episode; });
    }
  }
  function find(policy, episode) { return flights.find((flight) => flight.policy === policy && flight.episode === episode); }
  function showHash() {
    const parts = decodeURIComponent(location.hash).match(/^#flight\/(.+)\/(\d+)$/);
    const flight = parts && find(parts[1], Number(parts[2]));
    if (flight) { show(flight, besideSelect.value); element("browser").scrollIntoView(); }
    return Boolean(flight);
  }
  policySelect.replaceChildren(...[...new Set(flights.map((flight) => flight.policy))].map((name) => new Option(name, name)));
  policySelect.addEventListener("change", () => show(find(policySelect.value, current.episode) || flights.find((flight) => flight.policy === policySelect.value), besideSelect.value));
  episodeSelect.addEventListener("change", () => show(find(policySelect.value, Number(episodeSelect.value)), besideSelect.value));
  besideSelect.addEventListener("change", () => show(current, besideSelect.value));
  const step = (by) => show(flights[(flights.indexOf(current) + by + flights.length) % flights.length], besideSelect.value);
  element("previous").addEventListener("click", () => step(-1));
  element("next").addEventListener("click", () => step(1));
  look.addEventListener("input", () => { const data = dataOf(current); showMoment(lander.nodeAt(data, data.looks[Number(look.value)].time)); drawMap(current); });
  moment.addEventListener("input", () => {
    const newest = lander.lookAt(dataOf(current), Number(moment.value));
    showMoment(Number(moment.value));
    if (newest !== Number(look.value)) { look.value = newest; drawMap(current); }
  });
  element("controls").addEventListener("submit", (event) => event.preventDefault());
  window.addEventListener("hashchange", showHash);
  if (window.innerWidth < 700) element("flights-in-words").open = false;  // a long way to scroll on a phone
  if (!showHash()) show(find(opening.policy, opening.episode), opening.beside);
})();
