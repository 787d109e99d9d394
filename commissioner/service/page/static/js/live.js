/* The live view: current and flux against their limits, parameters as they converge. Numbers come ten times a second. */
import { number, on, say, send } from "./page.js";

const $ = (selector) => document.querySelector(selector);
const WINDOW_S = 2,
  FLUX_WINDOW_S = 8;
const FACTOR = [1, 1, 1e3, 1e3],
  DIGITS = [3, 3, 3, 1],
  SYMBOL = ["s", "R", "σ", "M"].map((index, k) => `${k < 2 ? "R" : "L"}<sub>${index}</sub>`);
const WANTED = [
  "resistance_std_percent",
  "rotor_resistance_std_percent",
  "leakage_std_percent",
  "magnetizing_std_percent",
];
if ($("#livedata")) begin(); /* a run may have ended, and its page have changed, before this file was here */
function begin() {
  const first = JSON.parse($("#livedata").textContent),
    acceptance = first.acceptance;
  let limits = { current: first.live.current.limit_a, flux: first.live.flux.limit_wb };
  let current = { t: [], low: [], high: [] },
    flux = { t: [], y: [] },
    history = [],
    newest = performance.now(),
    segment = null,
    isOn = first.live.output === "on";

  /* ---- plots --------------------------------------------------------------------------------------------------------- */
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  function limitLines(value) {
    return {
      hooks: {
        draw: [
          (u) => {
            const limit = value();
            if (!limit) return;
            const c = u.ctx,
              q = devicePixelRatio;
            c.save();
            c.strokeStyle = css("--limit");
            c.lineWidth = 2 * q;
            c.setLineDash([8 * q, 4 * q]);
            for (const y of limit) {
              const p = u.valToPos(y, "y", true);
              c.beginPath();
              c.moveTo(u.bbox.left, p);
              c.lineTo(u.bbox.left + u.bbox.width, p);
              c.stroke();
            }
            c.restore();
          },
        ],
      },
    };
  }
  function plot(element, span, range, splits, series, limit, bands) {
    const size = () => ({ width: Math.max(160, element.clientWidth), height: Math.max(80, element.clientHeight) });
    const axis = {
      stroke: () => css("--ink2"),
      grid: { stroke: () => css("--line"), width: 1 },
      ticks: { show: false },
      font: "12px Plex, sans-serif",
    };
    const made = new uPlot(
      {
        ...size(),
        legend: { show: false },
        cursor: { show: false },
        padding: [8, 8, 0, 0],
        scales: { x: { time: false, range: (u, low, high) => [(high ?? span) - span, high ?? span] }, y: { range } },
        axes: [
          {
            ...axis,
            size: 24,
            splits: (u) => [0, 1, 2, 3, 4].map((k) => u.scales.x.max - span + (k * span) / 4),
            values: (u, at) => at.map((x) => number(x - u.scales.x.max, 1, "s")),
          },
          {
            ...axis,
            size: 48,
            splits,
            values: (u, at) => at.map((y) => number(y, Math.abs(y) < 1 && y !== 0 ? 2 : 0)),
          },
        ],
        series: [
          {},
          ...series.map((extra) => ({
            stroke: () => css("--trace"),
            width: 1.2,
            points: { show: false },
            spanGaps: false,
            ...extra,
          })),
        ],
        bands,
        plugins: [limitLines(limit)],
      },
      [[], ...series.map(() => [])],
      element,
    );
    new ResizeObserver(() => made.setSize(size())).observe(element);
    return made;
  }
  const currentTop = () => 1.12 * (limits.current ?? 1),
    fluxTop = () => 1.12 * (limits.flux ?? 1);
  const plots = {
    current: plot(
      $("#pi"),
      WINDOW_S,
      () => [-currentTop(), currentTop()],
      () => [-Math.round(limits.current ?? 1), 0, Math.round(limits.current ?? 1)],
      [{}, {}],
      () => limits.current && [limits.current, -limits.current],
      [{ series: [2, 1], fill: () => css("--band95") }],
    ),
    flux: plot(
      $("#pf"),
      FLUX_WINDOW_S,
      () => [0, fluxTop()],
      () => [0, 0.5 * (limits.flux ?? 1), limits.flux ?? 1],
      [{ width: 1.6 }],
      () => limits.flux && [limits.flux],
      [],
    ),
  };

  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    for (const made of Object.values(plots)) made.redraw(false, true);
  });

  /* ---- samples ---------------------------------------------------------------------------------------------------------- */
  on("samples", (event) => {
    if (event.segment !== segment && current.t.length) {
      current.t.push(event.t_s[0] - 1e-3);
      current.low.push(null);
      current.high.push(null);
    }
    segment = event.segment;
    current.t.push(...event.t_s);
    current.low.push(...event.low_a);
    current.high.push(...event.high_a);
    const from = current.t.findIndex((t) => t > current.t.at(-1) - WINDOW_S - 0.1);
    if (from > 400) for (const list of Object.values(current)) list.splice(0, from);
    newest = performance.now();
    draw();
  });
  let drawing = false;
  function draw() {
    if (drawing || document.hidden) return;
    drawing = true;
    requestAnimationFrame(() => {
      drawing = false;
      plots.current.setData([current.t, current.low, current.high]);
      plots.flux.setData([flux.t, flux.y]);
    });
  }

  /* ---- numbers ------------------------------------------------------------------------------------------------------------ */
  function gauge(id, now, high, limit, digits, unit) {
    const box = $(id),
      scale = limit ? 926 / limit : 0;
    box.querySelector("[data-now]").textContent = number(now, digits);
    box.querySelector("[data-bar]").setAttribute("width", Math.min(1000, scale * (now ?? 0)));
    box.querySelector("[data-peak]").setAttribute("x", Math.min(996, Math.max(0, scale * (high ?? 0) - 2)));
    box.querySelector("[data-high]").textContent = number(high, digits, unit);
    box.querySelector("[data-limit]").textContent = number(limit, digits, unit);
  }
  const axisName = (test, k, tests) =>
    `${number(test.axis_deg, 0)}°${k && test.axis_deg === tests[0].axis_deg ? ` ${say("again")}` : ""}`;
  function item(test, k, tests) {
    const made = $("#testitem").content.firstElementChild.cloneNode(true);
    made.dataset.test = k;
    made.querySelector("b").textContent = axisName(test, k, tests);
    return made;
  }
  function progress(live) {
    const list = $("#progress");
    if (live.tests.length && !list.querySelector("[data-test]")) list.replaceChildren(...live.tests.map(item));
    live.tests.forEach((test, k) => {
      const item = list.querySelector(`[data-test="${k}"]`),
        is = k + 1 === live.test;
      const share = test.state === "done" ? 1 : is ? Math.min(0.99, test.energised_s / (live.planned_s || 1)) : 0;
      item.querySelector(".pfill").setAttribute("width", 100 * share);
      if (is) item.setAttribute("aria-current", "step");
      else item.removeAttribute("aria-current");
      item.querySelector("span").textContent =
        test.state === "done"
          ? say("done, %s", number(test.energised_s, 1, "s"))
          : say(test.state === "running" ? "running" : "waits");
    });
    if (live.test) $("#prog").textContent = say("Test %k of %n", live.test, live.tests.length);
    const test = live.test ? live.tests[live.test - 1] : null;
    $("#partname").textContent = test
      ? `${live.output === "on" ? "" : `${say("between tests")}, `}${say("%a of %b", number(test.energised_s, 1), number(live.planned_s, 1, "s"))}`
      : "";
  }
  function parameters(live) {
    const test = live.test ? live.tests[live.test - 1] : live.tests.at(-1),
      done = live.tests.filter((one) => one.state === "done" && one.parameters).at(-1);
    const show = (one, value, error) => {
      for (let k = 0; k < 4; k += 1) {
        $(value(k)).textContent = one?.parameters ? number(FACTOR[k] * one.parameters[k], DIGITS[k]) : "–";
        $(error(k)).textContent = one?.parameters ? `± ${number(1.96 * FACTOR[k] * one.std[k], DIGITS[k])}` : "";
      }
    };
    show(
      done,
      (k) => `[data-last="${k}"]`,
      (k) => `[data-lasterr="${k}"]`,
    );
    show(
      test,
      (k) => `[data-p="${k}"]`,
      (k) => `[data-e="${k}"]`,
    );
    if (done) $("#lasthead").textContent = say("%a, done", `${number(done.axis_deg, 0)}°`);
    if (test) $("#nowhead").textContent = say("%a, now", `${number(test.axis_deg, 0)}°`);
    if (!test?.parameters) return;
    const above = SYMBOL.filter((_, k) => (100 * test.std[k]) / test.parameters[k] > (acceptance[WANTED[k]] ?? 3));
    $("#settle").innerHTML = above.length
      ? say("Still above the wanted standard error: %s. Strip: ± 10 %.", above.join(", "))
      : say("All four within the wanted standard error. Preliminary: the fit after the test decides. Strip: ± 10 %.");
  }
  function sparks() {
    if (!history.length) return;
    const last = history.at(-1),
      end = Math.max(6.2, last[0]);
    for (let k = 0; k < 4; k += 1) {
      const reference = last[1 + k],
        x = (t) => ((132 * t) / end).toFixed(1),
        y = (v) => Math.max(1, Math.min(39, 20 - (18 * (v / reference - 1)) / 0.1)).toFixed(1);
      const upper = history.map((e) => `${x(e[0])},${y(e[1 + k] + 1.96 * e[5 + k])}`),
        lower = history.map((e) => `${x(e[0])},${y(e[1 + k] - 1.96 * e[5 + k])}`).reverse();
      const middle = history.map((e) => `${x(e[0])},${y(e[1 + k])}`);
      $(`[data-s="${k}"]`).innerHTML =
        `<line class="szero" x1="0" x2="132" y1="20" y2="20"/><polygon class="sband" points="${[...upper, ...lower].join(" ")}"/><polyline class="sline" points="${middle.join(" ")}"/>`;
    }
  }
  function show(live) {
    if (!$("#live")) return;
    limits = { current: live.current.limit_a ?? limits.current, flux: live.flux.limit_wb ?? limits.flux };
    gauge("#gi", live.current.now_a, live.current.high_a, live.current.limit_a, 2, "A");
    gauge("#gf", live.flux.now_wb, live.flux.high_wb, live.flux.limit_wb, 3, "Wb");
    progress(live);
    parameters(live);
    const estimate = live.estimate;
    if (estimate && (history.length === 0 || estimate[0] !== history.at(-1)[0])) {
      if (history.length && estimate[0] < history.at(-1)[0]) {
        history = [];
        flux = { t: [], y: [] };
      }
      history.push(estimate);
      sparks();
      if (live.flux.now_wb !== null) {
        flux.t.push(estimate[0]);
        flux.y.push(live.flux.now_wb);
      }
    }
    draw();
  }
  on("live", (live) => {
    newest = performance.now();
    isOn = live.output === "on";
    show(live);
  });
  on("history", (past) => {
    history = past;
    sparks();
  });
  setInterval(() => {
    const age = $("#age");
    if (!age) return;
    const seconds = (performance.now() - newest) / 1000;
    const isSilent = isOn && seconds > 1; /* between tests the computer works and nothing is said: that is no loss */
    age.textContent = say(isSilent && seconds > 2 ? "%s old: stale" : "%s old", number(seconds, 1, "s"));
    age.classList.toggle("old", isSilent);
    $("#live")?.classList.toggle("stale", seconds > 2);
  }, 200);
  show(first.live);

  /* ---- lost, and control --------------------------------------------------------------------------------------------------- */
  function lost(id, isLost) {
    const shown = document.querySelector(`main > [data-from="${id}"]`);
    if (!isLost) {
      shown?.remove();
      return;
    }
    if (shown || !$(`#${id}`)) return;
    const box = $(`#${id}`).content.firstElementChild.cloneNode(true);
    box.dataset.from = id;
    $("#main").prepend(box);
  }
  on("offline", (is) => lost("lostpage", is));
  on("band", (band) => {
    lost("lostdrive", band.level === "alarm");
    const button = (name) => document.querySelector(`[data-control="${name}"]`);
    if (!button("ask")) return;
    button("ask").hidden = band.has_control || !band.is_held;
    for (const name of ["grant", "refuse"]) button(name).hidden = !(band.has_control && band.asking);
  });
  for (const button of document.querySelectorAll("[data-control]"))
    button.addEventListener("click", () => send({ control: button.dataset.control }));
  on("control", (control) => {
    if (control.asking && $("#asking"))
      $("#asking").textContent =
        `${control.asking} ${say("asks for control; without an answer it passes in %s", number(control.wait_s, 0, "s"))}`;
  });
  on("refused", (problem) => {
    if ($("#asking")) $("#asking").textContent = problem.title;
  });
}
