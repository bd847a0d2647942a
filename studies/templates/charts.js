"use strict";
// Charts: drawn when they come near the screen, and before printing.
const Report = (function () {
  const read = (id) => JSON.parse(document.getElementById(id).textContent);
  const charts = read("charts-data");
  const config = { responsive: true, displaylogo: false, displayModeBar: false };
  const narrow = 700;  // [px] the legend goes below a chart that is narrower

  const waiting = new Map();
  const watcher = new IntersectionObserver((entries) => {
    for (const entry of entries) if (entry.isIntersecting) draw(entry.target);
  }, { rootMargin: "300px" });
  function later(node, make) { waiting.set(node, make); watcher.observe(node); }
  function draw(node) {
    const make = waiting.get(node);
    if (!make) return;
    waiting.delete(node);
    watcher.unobserve(node);
    make();
  }
  window.addEventListener("beforeprint", () => { for (const node of [...waiting.keys()]) draw(node); });

  function fit(node, layout) {
    if (node.dataset.chart !== "headline" || node.clientWidth >= narrow) return layout;
    const entries = charts.headline.data.length;
    return Object.assign({}, layout, {
      height: 400 + 10 * entries, margin: Object.assign({}, layout.margin, { l: 44, r: 8 }),
      legend: {
        orientation: "h", x: -0.12, y: -0.2, yanchor: "top", font: { size: 11 }, entrywidth: 0.5, entrywidthmode: "fraction", maxheight: 600,
      },
    });
  }
  for (const node of document.querySelectorAll("[data-chart]")) {
    const figure = charts[node.dataset.chart];
    later(node, () => {
      const layout = fit(node, figure.layout);
      if (layout.height) node.style.height = layout.height + "px";
      Plotly.newPlot(node, figure.data, layout, config).then(() => {
        if (node.dataset.chart.startsWith("distribution")) hideTraces(node);
      });
    });
  }

  // The policies that the distributions show.
  const legend = [...document.querySelectorAll("#legend button[data-trace]")];
  const pressed = (button) => button.getAttribute("aria-pressed") === "true";
  function hideTraces(node) { Plotly.restyle(node, { visible: legend.map(pressed) }); }
  function press(choose) {
    for (const button of legend) button.setAttribute("aria-pressed", String(choose(button)));
    for (const node of document.querySelectorAll('[data-chart^="distribution"]')) if (node.data) hideTraces(node);
  }
  for (const button of legend) {
    button.addEventListener("click", () => press((other) => (other === button) !== pressed(other)));
  }
  for (const button of document.querySelectorAll("#legend button[data-choice]")) {
    button.addEventListener("click", () => press((other) => button.dataset.choice === "all" || "shown" in other.dataset));
  }
  return { read, later, config };
})();
