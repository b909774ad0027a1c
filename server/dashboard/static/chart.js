// Draws what the table shows, from the API's answer to the same query string.
const SYMBOLS = ["circle", "diamond", "square", "triangle-up", "cross", "star"];
const holder = document.getElementById("chart");
const title = document.getElementById("chart-title");

// plotly reads a few HTML tags in texts: names stay names.
const plain = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
const label = (key) => plain(Object.values(key).join(" / "));
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function cellsOf(view, column) {
  return view.table.map((row) => ({ name: label(row.key), cell: row.cells[column] })).filter((entry) => entry.cell);
}

function metricTrace(view, column, index) {
  const key = view.metric.key;
  const entries = cellsOf(view, index).filter(({ cell }) => cell.figures[key].value !== null);
  const figures = entries.map(({ cell }) => cell.figures[key]);
  const away = (end) => figures.map((f) => (f[end] === null ? 0 : Math.abs(f[end] - f.value)));
  return {
    x: figures.map((f) => f.value),
    y: entries.map(({ name }) => name),
    error_x: { type: "data", array: away("high"), arrayminus: away("low"), thickness: 1.5, width: 4 },
  };
}

function errorTrace(view, column, index) {
  const entries = cellsOf(view, index).filter(
    ({ cell }) => cell.figures.error_total.value !== null && cell.figures.mrays_per_s.value !== null,
  );
  const speeds = entries.map(({ cell }) => cell.figures.mrays_per_s);
  const away = (end) => speeds.map((f) => (f[end] === null ? 0 : Math.abs(f[end] - f.value)));
  return {
    x: entries.map(({ cell }) => cell.figures.error_total.value),
    y: speeds.map((f) => f.value),
    text: entries.map(({ name }) => name),
    error_y: { type: "data", array: away("high"), arrayminus: away("low"), thickness: 1.5, width: 4 },
  };
}

function traces(view, make) {
  const colours = style("--series").split(" ");
  return view.column_keys.map((column, index) => ({
    type: "scatter",
    mode: "markers",
    name: label(column),
    marker: { size: 10, symbol: SYMBOLS[index % SYMBOLS.length], color: colours[index % colours.length] },
    ...make(view, column, index),
  }));
}

// Zero is a result here, so it stands clear of the frame, also where every error is zero.
function errorRange(data) {
  const greatest = Math.max(1e-6, ...data.flatMap((trace) => trace.x));
  return [-0.05 * greatest, 1.1 * greatest];
}

function layout(view, kind, data) {
  const axis = { gridcolor: style("--line"), zerolinecolor: style("--line"), rangemode: "tozero", automargin: true };
  const metric = plain(`${view.metric.label}${view.metric.unit ? `, ${view.metric.unit}` : ""}`);
  const names = view.table.map((row) => label(row.key));
  const category = { ...axis, rangemode: "normal", type: "category", categoryarray: names, autorange: "reversed" };
  const byMetric = { xaxis: { ...axis, title: { text: metric } }, yaxis: category };
  const byError = {
    xaxis: { ...axis, rangemode: "normal", range: errorRange(data), exponentformat: "power", title: { text: "error, fraction of rays" } },
    yaxis: { ...axis, title: { text: "speed, Mray/s" } },
  };
  return {
    ...(kind === "error" ? byError : byMetric),
    height: kind === "error" ? 420 : 140 + 44 * names.length,
    margin: { t: 16, r: 24, b: 56, l: 64 },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: style("--font"), color: style("--ink"), size: 13 },
    legend: { orientation: "h", y: 1.02, yanchor: "bottom" },
    showlegend: true,
  };
}

async function draw() {
  const kind = holder.dataset.chart;
  const answer = await fetch(`/api/v1/compare${location.search}`);
  if (!answer.ok) return;
  const view = await answer.json();
  title.textContent = kind === "error" ? "Speed against error" : `${view.metric.label}, with 95 % intervals`;
  const data = traces(view, kind === "error" ? errorTrace : metricTrace);
  const options = { displayModeBar: false, responsive: true };
  await window.Plotly.react(holder, data, layout(view, kind, data), options);
  holder.dataset.drawn = "yes";
}

draw();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
