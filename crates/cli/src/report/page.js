"use strict";
(() => {
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const root = document.documentElement;
  const button = document.getElementById("theme");
  // Okabe and Ito; the darker ones are lightened on a dark page
  const inks = {
    light: { "@raw": "#d55e00", "@declared": "#0072b2", "@discovered": "#009e73", "@4": "#cc79a7", "@5": "#e69f00",
      "@6": "#56b4e9", "@7": "#333333", "@muted": "#777777", "@band": "rgba(120,120,120,0.18)" },
    dark: { "@raw": "#ff8c3a", "@declared": "#56b4e9", "@discovered": "#2fd3a4", "@4": "#e9a3c9", "@5": "#f0c14b",
      "@6": "#9ad5ff", "@7": "#dddddd", "@muted": "#a0a0a0", "@band": "rgba(200,200,200,0.18)" },
  };
  const NARROW_PX = 600;
  const prefersDark = matchMedia("(prefers-color-scheme: dark)");
  let chosen = null;
  const theme = () => chosen || (prefersDark.matches ? "dark" : "light");
  const inked = (value, ink) => {
    if (typeof value === "string") return ink[value] || value;
    // data have no colours
    if (Array.isArray(value)) return typeof value[0] === "number" ? value : value.map((v) => inked(v, ink));
    if (value && typeof value === "object")
      return Object.fromEntries(Object.entries(value).map(([k, v]) => [k, inked(v, ink)]));
    return value;
  };
  const styled = (figure, name, width) => {
    const dark = name === "dark";
    const [fg, grid] = dark ? ["#ececec", "#343a40"] : ["#1a1a1a", "#e4e4e4"];
    const layout = inked(figure.layout, inks[name]);
    const traces = inked(figure.traces, inks[name]);
    for (const key of Object.keys(layout))
      if (/^[xy]axis/.test(key))
        layout[key] = { gridcolor: grid, zerolinecolor: grid, linecolor: grid, automargin: true, ...layout[key] };
    // a narrow page has no room for the names twice: the columns are in the order of the rows
    if (figure.id === "correlations" && (width || innerWidth) < NARROW_PX) {
      layout.xaxis = { ...layout.xaxis, showticklabels: false };
      layout.margin = { l: 150, r: 8, t: 16, b: 24 };
    }
    // nor for two panels beside each other: the second goes below the first
    if (layout.xaxis2 && layout.xaxis.domain && (width || innerWidth) < NARROW_PX) {
      // with a y axis of its own, and the range of the first, where they had one together
      if (!layout.yaxis2) {
        layout.yaxis2 = { ...layout.yaxis, anchor: "x2", matches: "y" };
        layout.xaxis2 = { ...layout.xaxis2, anchor: "y2" };
        for (const trace of traces) if (trace.xaxis === "x2") trace.yaxis = "y2";
      }
      for (const [x, y, domain] of [["xaxis", "yaxis", [0.6, 1]], ["xaxis2", "yaxis2", [0, 0.4]]]) {
        layout[x] = { ...layout[x], domain: [0, 1], nticks: 6 };
        layout[y] = { ...layout[y], domain, nticks: 5 };
      }
      layout.height = 560;
    }
    return {
      traces,
      layout: {
        margin: { l: 64, r: 16, t: 16, b: 48 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
        font: { color: fg, family: "system-ui, sans-serif", size: 13 }, hovermode: "closest",
        hoverlabel: { bgcolor: dark ? "#2a3036" : "#ffffff", font: { color: fg } },
        legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 }, ...layout, ...(width ? { width } : {}),
      },
    };
  };
  const options = { responsive: true, displaylogo: false };
  const hidden = new Map();
  const draw = (figure, name = theme(), width = null) => {
    const target = document.getElementById("plot-" + figure.id);
    const { traces, layout } = styled(figure, name, width);
    const off = hidden.get(figure.id);
    if (off) for (const trace of traces) if (off.has(trace.meta)) trace.visible = false;
    // a figure that has a height of its own makes room for itself
    target.style.height = layout.height ? layout.height + "px" : "";
    return Plotly.react(target, traces, layout, options).then(() => { target.dataset.drawn = "true"; });
  };
  const drawn = () => figures.filter((f) => document.getElementById("plot-" + f.id).dataset.drawn);
  const retheme = () => {
    root.dataset.theme = theme();
    button.textContent = theme() === "dark" ? "Light" : "Dark";
    drawn().forEach((figure) => draw(figure));
  };
  button.hidden = false;
  button.addEventListener("click", () => { chosen = theme() === "dark" ? "light" : "dark"; retheme(); });
  prefersDark.addEventListener("change", retheme);
  retheme();

  for (const toggle of document.querySelectorAll("button[data-of]"))
    toggle.addEventListener("click", () => {
      const id = toggle.dataset.of;
      const off = hidden.get(id) || hidden.set(id, new Set()).get(id);
      const on = toggle.getAttribute("aria-pressed") !== "true";
      toggle.setAttribute("aria-pressed", String(on));
      if (on) off.delete(toggle.dataset.series); else off.add(toggle.dataset.series);
      draw(figures.find((f) => f.id === id));
    });

  // arrows move, + and - zoom, 0 shows all
  const axes = (target, letter) => Object.keys(target._fullLayout).filter((k) => new RegExp(`^${letter}axis\\d*$`).test(k));
  const move = (target, letter, change) => {
    const update = {};
    for (const name of axes(target, letter)) {
      const range = target._fullLayout[name].range.map(Number);
      if (range.every(Number.isFinite)) update[name + ".range"] = change(range);
    }
    Plotly.relayout(target, update);
  };
  const shift = (share) => ([a, b]) => [a + share * (b - a), b + share * (b - a)];
  const zoom = (by) => ([a, b]) => [(a + b) / 2 - by * (b - a) / 2, (a + b) / 2 + by * (b - a) / 2];
  const keys = {
    ArrowLeft: (t) => move(t, "x", shift(-0.1)), ArrowRight: (t) => move(t, "x", shift(0.1)),
    ArrowDown: (t) => move(t, "y", shift(-0.1)), ArrowUp: (t) => move(t, "y", shift(0.1)),
    "+": (t) => { move(t, "x", zoom(0.7)); move(t, "y", zoom(0.7)); },
    "-": (t) => { move(t, "x", zoom(1 / 0.7)); move(t, "y", zoom(1 / 0.7)); },
    0: (t) => Plotly.relayout(t, Object.fromEntries([...axes(t, "x"), ...axes(t, "y")].map((a) => [a + ".autorange", true]))),
  };
  for (const target of document.querySelectorAll(".plot"))
    target.addEventListener("keydown", (event) => {
      const act = keys[event.key];
      if (!act || !target.dataset.drawn || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      act(target);
    });

  // the first is drawn at once, the rest while the reader asks for nothing
  const queue = [...figures];
  const whenIdle = window.requestIdleCallback ? (f) => requestIdleCallback(f, { timeout: 500 }) : setTimeout;
  const next = () => {
    const figure = queue.shift();
    if (!figure) { root.dataset.ready = "true"; return; }
    draw(figure).then(() => whenIdle(next));
  };
  requestAnimationFrame(() => setTimeout(next));
  addEventListener("beforeprint", () => { root.dataset.theme = "light"; figures.forEach((f) => draw(f, "light", 680)); });
  addEventListener("afterprint", () => { root.dataset.theme = theme(); figures.forEach((f) => draw(f)); });
})();
