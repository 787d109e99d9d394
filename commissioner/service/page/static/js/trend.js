/* A motor over the years: each measurement with its 95 % interval. */
import { number } from "./page.js";

const points = JSON.parse(document.querySelector("#trenddata").textContent);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const times = points.map((point) => Date.parse(point.utc) / 1000);
const day =
  times.at(-1) - times[0] > 3 * 86400 ? (utc) => utc.slice(0, 10) : (utc) => utc.slice(5, 16).replace("T", " ");
/* Places of a tick: as many as the step to the next one has. */
const placesOf = (step) =>
  [0, 1, 2, 3, 4, 5].find((n) => Math.abs(step * 10 ** n - Math.round(step * 10 ** n)) < 1e-6) ?? 6;

for (const element of document.querySelectorAll("[data-trend]")) {
  const factor = Number(element.dataset.factor),
    values = points.map((p) => p.parameters[element.dataset.trend]);
  const y = values.map((v) => factor * v.value),
    error = values.map((v) => 1.96 * factor * v.std);
  const low = Math.min(...y.map((v, k) => v - error[k])),
    high = Math.max(...y.map((v, k) => v + error[k])),
    margin = 0.2 * (high - low) || 0.05 * high;
  const marks = (u) => {
    const c = u.ctx,
      q = devicePixelRatio;
    c.save();
    c.strokeStyle = c.fillStyle = css("--trace");
    c.lineWidth = 2 * q;
    times.forEach((t, k) => {
      const x = u.valToPos(t, "x", true);
      c.beginPath();
      c.moveTo(x, u.valToPos(y[k] + error[k], "y", true));
      c.lineTo(x, u.valToPos(y[k] - error[k], "y", true));
      c.stroke();
      c.beginPath();
      c.arc(x, u.valToPos(y[k], "y", true), 4 * q, 0, 7);
      c.fill();
    });
    c.restore();
  };
  const size = () => ({ width: Math.max(160, element.clientWidth), height: Math.max(100, element.clientHeight) });
  const axis = {
    stroke: () => css("--ink2"),
    grid: { stroke: () => css("--line"), width: 1 },
    ticks: { show: false },
    font: "12px Plex, sans-serif",
  };
  const pad = 0.06 * (times.at(-1) - times[0]) || 86400;
  const made = new uPlot(
    {
      ...size(),
      padding: [null, 36, null, null],
      legend: { show: false },
      cursor: { show: false },
      scales: {
        x: { time: true, range: [times[0] - pad, times.at(-1) + pad] },
        y: { range: [low - margin, high + margin] },
      },
      axes: [
        { ...axis, size: 28, space: 90, values: (u, at) => at.map((t) => day(new Date(1000 * t).toISOString())) },
        { ...axis, size: 56, values: (u, at, index, space, step) => at.map((v) => number(v, placesOf(step))) },
      ],
      series: [{}, { stroke: "transparent", width: 0, points: { show: false } }],
      hooks: { draw: [marks] },
    },
    [times, y],
    element,
  );
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => made.redraw());
  new ResizeObserver(() => made.setSize(size())).observe(element);
}
