// Draws a job's frames in order, with rounds, median and interval; a phone's counters in panes below, along the same frames.
const PANES = ["°C", "MHz", "%"];
const CLOCKS = [["wall_ms", "wall", "circle"], ["cpu_ms", "CPU", "diamond"], ["gpu_ms", "GPU", "square"]];
const FEW_ROUNDS = 12;
const FEW_FRAMES = 1000;
const FRAMES_PX = 300;
const PANE_PX = 120;
const EDGES_PX = 110;
const holder = document.getElementById("chart");
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const known = (values) => values.some((value) => value !== null);

function clockTraces(view, colours) {
  const text = view.frames.map((frame) => `round ${frame.round}, frame ${frame.index}`);
  const x = view.frames.map((_, i) => i + 1);
  return CLOCKS.map(([key, name, symbol], i) => ({
    x, text, name, type: "scatter", mode: view.frames.length > FEW_FRAMES ? "lines" : "markers", y: view.frames.map((frame) => frame[key]),
    marker: { size: 7, symbol, color: colours[i] }, line: { width: 1, color: colours[i] }, hovertemplate: "%{y:.4g} ms, %{text}",
  })).filter((trace) => known(trace.y));
}

function medianTraces(view) {
  const { median, ci_low: low, ci_high: high } = view.frame_ms ?? {};
  const ends = [0.5, view.frames.length + 0.5];
  const plain = { type: "scatter", mode: "lines", hoverinfo: "skip" };
  const band = { ...plain, name: "95 % interval", x: [...ends, ends[1], ends[0]], y: [low, low, high, high],
    fill: "toself", fillcolor: style("--soft"), line: { width: 0 } };
  const line = { ...plain, name: "median", x: ends, y: [median, median], line: { color: style("--ink"), width: 1.2 } };
  return [low && high ? [band] : [], median ? [line] : []].flat();
}

function readingTraces(view, panes, colours) {
  return view.readings.filter(({ unit }) => panes.includes(unit)).map((reading, i) => ({
    x: reading.values.map((_, n) => n + 1), y: reading.values, name: reading.label, type: "scatter",
    mode: reading.values.length > FEW_FRAMES ? "lines" : "lines+markers", yaxis: `y${panes.indexOf(reading.unit) + 2}`, connectgaps: false,
    marker: { size: 4 }, line: { color: colours[(i + CLOCKS.length) % colours.length], width: 1.5, shape: "hv" },
    hovertemplate: `%{y:.4g} ${reading.unit}`,
  }));
}

// Rounds as lines between them, throttling as a shade behind them; both through all panes.
function roundShapes(view) {
  const upright = { yref: "paper", y0: 0, y1: 1, layer: "below" };
  const borders = view.rounds.slice(1).map(({ first }) => ({
    ...upright, type: "line", x0: first + 0.5, x1: first + 0.5, line: { color: style("--quiet"), width: 1, dash: "dot" },
  }));
  const shades = view.rounds.filter(({ throttled }) => throttled).map(({ first, frames }) => ({
    ...upright, type: "rect", x0: first + 0.5, x1: first + frames + 0.5, fillcolor: style("--warn-soft"), line: { width: 0 },
  }));
  return [...shades, ...borders];
}

function roundNames(view) {
  return view.rounds
    .filter(({ throttled }) => throttled || view.rounds.length <= FEW_ROUNDS)
    .map(({ number, first, frames, throttled }) => ({
      x: first + frames / 2 + 0.5, y: 1, yref: "paper", yanchor: "bottom", showarrow: false,
      text: throttled ? `${number}: throttled` : `round ${number}`,
      font: { size: 12, color: style(throttled ? "--warn" : "--quiet") },
    }));
}

function axes(view, panes) {
  const total = FRAMES_PX + panes.length * PANE_PX;
  const axis = { gridcolor: style("--line"), zerolinecolor: style("--line"), automargin: true };
  const bottom = (panes.length * PANE_PX) / total;
  const found = { yaxis: { ...axis, domain: [bottom + (panes.length ? 0.04 : 0), 1], rangemode: "tozero", title: { text: "frame, ms" } } };
  panes.forEach((unit, i) => {
    const top = bottom - (i * PANE_PX) / total;
    found[`yaxis${i + 2}`] = { ...axis, domain: [top - PANE_PX / total + 0.03, top], title: { text: unit }, nticks: 6,
      ...(unit === "%" ? { range: [-5, 105] } : {}) };
  });
  const anchor = panes.length ? `y${panes.length + 1}` : "y";
  const range = [0.5, view.frames.length + 0.5];
  return { ...found, xaxis: { ...axis, anchor, range, title: { text: "frame, in the order measured" }, tickformat: "d" } };
}

function layout(view, panes) {
  return {
    ...axes(view, panes),
    height: FRAMES_PX + panes.length * PANE_PX + EDGES_PX,
    margin: { t: 56, r: 12, b: 48, l: 56 },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: style("--font"), color: style("--ink"), size: 13 },
    hoverlabel: { namelength: -1 },
    legend: { orientation: "h", y: 1, yref: "container", yanchor: "top" },
    showlegend: true,
    shapes: roundShapes(view),
    annotations: roundNames(view),
  };
}

async function draw() {
  const answer = await fetch(holder.dataset.frames);
  if (!answer.ok) return;
  const view = await answer.json();
  const colours = style("--series").split(" ");
  const panes = PANES.filter((unit) => view.readings.some((reading) => reading.unit === unit));
  const data = [...medianTraces(view), ...clockTraces(view, colours), ...readingTraces(view, panes, colours)];
  const shape = layout(view, panes);
  holder.style.height = `${shape.height}px`;
  await window.Plotly.react(holder, data, shape, { displayModeBar: false, responsive: true });
  holder.dataset.drawn = "yes";
}

draw();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
