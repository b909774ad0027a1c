// Draws what the table shows, from the API's answer to the same query string.
const SYMBOLS = ["circle", "diamond", "square", "triangle-up", "cross", "star"];
const holder = document.getElementById("chart");
const { x: xKey, y: yKey, front } = holder.dataset;

// plotly reads a few HTML tags in texts: names stay names.
const plain = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
const label = (key) => plain(Object.values(key).join(" / "));
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function away(figures) {
  const end = (name) => figures.map((f) => (f[name] === null ? 0 : Math.abs(f[name] - f.value)));
  return { type: "data", array: end("high"), arrayminus: end("low"), thickness: 1.5, width: 4 };
}

function entriesOf(view, column) {
  const entries = view.table.map((row, place) => ({ name: label(row.key), place, cell: row.cells[column] }));
  const keys = xKey ? [xKey, yKey] : [yKey];
  return entries.filter(({ cell }) => cell && keys.every((key) => cell.figures[key].value !== null));
}

// Without a horizontal metric the variants stand on the vertical axis and the metric lies along the other.
function points(view, column) {
  const entries = entriesOf(view, column);
  const names = entries.map(({ name }) => name);
  const ups = entries.map(({ cell }) => cell.figures[yKey]);
  if (!xKey) return { x: ups.map((f) => f.value), y: names, error_x: away(ups) };
  const across = entries.map(({ cell }) => cell.figures[xKey]);
  const on = front ? view.pareto[front][column] : null;
  const filled = entries.map(({ place }) => !on || on.includes(place));
  return {
    x: across.map((f) => f.value),
    y: ups.map((f) => f.value),
    text: names,
    error_x: away(across),
    error_y: away(ups),
    filled,
  };
}

function traces(view) {
  const colours = style("--series").split(" ");
  return view.column_keys.flatMap((key, column) => {
    const { filled, ...found } = points(view, column);
    const color = colours[column % colours.length];
    const symbol = SYMBOLS[column % SYMBOLS.length];
    const symbols = filled ? filled.map((on) => (on ? symbol : `${symbol}-open`)) : symbol;
    const name = label(key);
    const marks = { type: "scatter", mode: "markers", name, marker: { size: 10, symbol: symbols, color }, ...found };
    return [marks, ...frontOf(view, column, name, color)];
  });
}

// Between two points of the front the better speed is to be had only at the second's cost: a stair, no slope.
function frontOf(view, column, name, color) {
  const places = front ? view.pareto[front][column] : null;
  if (!places || places.length === 0) return [];
  const figures = places.map((place) => view.table[place].cells[column].figures);
  return [{
    type: "scatter",
    mode: "lines",
    name: `${name}, Pareto front`,
    x: figures.map((f) => f[xKey].value),
    y: figures.map((f) => f[yKey].value),
    line: { color, width: 1.5, dash: "dot", shape: "hv" },
    hoverinfo: "skip",
    showlegend: figures.length > 1,
  }];
}

// Zero is a result here, so it stands clear of the frame, also where every value is zero.
function range(values, kind) {
  const greatest = Math.max(kind === "fraction" ? 1e-6 : 0, ...values);
  return greatest > 0 ? [-0.04 * greatest, 1.1 * greatest] : [-0.04, 1.1];
}

function axis(side, values) {
  const { [`${side}Label`]: name, [`${side}Unit`]: unit, [`${side}Kind`]: kind } = holder.dataset;
  const shared = { gridcolor: style("--line"), zerolinecolor: style("--quiet"), automargin: true };
  const title = { text: plain(kind === "fraction" ? `${name}, fraction ${unit}` : unit ? `${name}, ${unit}` : name) };
  const digits = kind === "bytes" ? { tickformat: "~s", ticksuffix: "B" } : { exponentformat: "power" };
  return { ...shared, ...digits, title, range: range(values, kind) };
}

function ends(data, side) {
  const reach = (trace) => trace[side].map((value, i) => value + (trace[`error_${side}`]?.array[i] ?? 0));
  return data.filter((trace) => trace.mode === "markers").flatMap(reach);
}

function layout(view, data) {
  const names = view.table.map((row) => label(row.key));
  const category = { automargin: true, gridcolor: style("--line"), type: "category", categoryarray: names, autorange: "reversed" };
  const axes = xKey
    ? { xaxis: axis("x", ends(data, "x")), yaxis: axis("y", ends(data, "y")), height: 460 }
    : { xaxis: axis("y", ends(data, "x")), yaxis: category, height: 140 + 44 * names.length };
  return {
    ...axes,
    margin: { t: 16, r: 24, b: 56, l: 64 },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: style("--font"), color: style("--ink"), size: 13 },
    legend: { orientation: "h", y: 1.02, yanchor: "bottom" },
    showlegend: true,
  };
}

async function draw() {
  const answer = await fetch(`/api/v1/compare${location.search}`);
  if (!answer.ok) return;
  const view = await answer.json();
  const data = traces(view);
  const form = layout(view, data);
  holder.style.height = `${form.height}px`;
  await window.Plotly.react(holder, data, form, { displayModeBar: false, responsive: true });
  holder.dataset.drawn = "yes";
}

draw();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
