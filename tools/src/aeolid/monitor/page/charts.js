"use strict";
/* Draw with Plotly: a line with its band, tests against their bounds, the map of Markov parameters. */

const WIDE = 1.959964; // standard deviations on either side that hold 95 %
const POINTS = 400; // drawn of one line: more than a small chart has pixels for

/* Plotly takes text for markup; names are what a bus has brought. */
const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/* Seconds, minutes or hours, as suits a span of time. */
function timeUnit(span) {
  if (span > 7200) return { per: 3600, name: "h" };
  return span > 600 ? { per: 60, name: "min" } : { per: 1, name: "s" };
}

function thin(rows) {
  if (rows.length <= POINTS) return rows;
  const step = (rows.length - 1) / (POINTS - 1);
  return Array.from({ length: POINTS }, (_, i) => rows[Math.round(i * step)]);
}

/* Keep the rows of the newest `span` seconds; "" for all. */
function within(rows, span) {
  if (!span || !rows.length) return rows;
  const from = rows[rows.length - 1][0] - Number(span);
  return rows.filter((row) => row[0] >= from);
}

function layout(extra, height) {
  const axis = {
    gridcolor: colour("grid"), linecolor: colour("line"), zeroline: false, tickcolor: colour("line"), ticklen: 3,
    showline: true, tickfont: { size: 11, color: colour("soft") }, title: { font: { size: 11, color: colour("soft") } },
  };
  const merged = {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false, hovermode: "x unified",
    margin: { l: 50, r: 14, t: 5, b: 20 }, font: { family: "inherit", size: 11, color: colour("ink") },
    hoverlabel: { bgcolor: colour("panel"), bordercolor: colour("line"), font: { color: colour("ink"), size: 11 } },
    xaxis: { ...axis }, yaxis: { ...axis, nticks: 5, exponentformat: "power" }, dragmode: false,
  };
  for (const [key, value] of Object.entries(extra || {})) {
    merged[key] = key.endsWith("axis") ? { ...merged[key], ...value } : value;
  }
  return merged;
}

/* Drawings out of sight are left as they are until they are scrolled to. */
const seen = new WeakSet();
const pending = new WeakMap();
const watcher = new IntersectionObserver((entries) => {
  for (const entry of entries) {
    if (entry.isIntersecting) {
      seen.add(entry.target);
      const draw = pending.get(entry.target);
      pending.delete(entry.target);
      if (draw) draw();
    } else seen.delete(entry.target);
  }
}, { rootMargin: "200px" });

function draw(place, traces, extra, words) {
  if (words) place.setAttribute("aria-label", words);
  const now = () => Plotly.react(place, traces, layout(extra), { displayModeBar: false, responsive: true });
  if (seen.has(place)) return now();
  pending.set(place, now);
  watcher.observe(place);
}

/* Runs of a node stand one behind the other: lines break there, and a rule marks the place. */
function broken(rows, starts) {
  const out = [];
  let next = starts.findIndex((s) => rows.length && s > rows[0][0]);
  for (const row of rows) {
    while (next >= 0 && next < starts.length && row[0] >= starts[next]) {
      out.push([starts[next]]);
      next += 1;
    }
    out.push(row);
  }
  return out;
}

function rules(starts, from, to, per) {
  return starts.filter((s) => s > from && s < to).map((s) => ({
    type: "line", x0: s / per, x1: s / per, yref: "paper", y0: 0, y1: 1, line: { color: colour("soft"), width: 1, dash: "dot" },
  }));
}

function span(rows) {
  const first = rows.length ? rows[0][0] : 0, last = rows.length ? rows[rows.length - 1][0] : 1;
  return { first, last, unit: timeUnit(last - first) };
}

function timeAxis({ first, last, unit }) {
  const range = [first / unit.per, Math.max(last, first + 1) / unit.per];
  return { range, ticksuffix: ` ${unit.name}`, showticksuffix: "last", nticks: 8 };
}

/* rows: [time, value, deviation or null]. */
function drawBand(place, all, starts, words, factor = 1) {
  const over = span(all), per = over.unit.per;
  const rows = broken(thin(all), starts);
  const x = rows.map((r) => r[0] / per);
  const y = rows.map((r) => (r[1] == null ? null : factor * r[1]));
  const traces = [];
  /* one closed area for each stretch whose deviation is known */
  let part = [];
  const close = () => {
    if (part.length > 1) {
      traces.push({
        x: [...part.map((p) => p[0]), ...part.map((p) => p[0]).reverse()],
        y: [...part.map((p) => p[1]), ...part.map((p) => p[2]).reverse()],
        fill: "toself", fillcolor: colour("band"), line: { width: 0 }, mode: "lines", hoverinfo: "skip",
      });
    }
    part = [];
  };
  for (const r of rows) {
    if (r[1] == null || r[2] == null) { close(); continue; }
    part.push([r[0] / per, factor * (r[1] - WIDE * r[2]), factor * (r[1] + WIDE * r[2])]);
  }
  close();
  const anywhere = rows.filter((r) => r[1] != null), present = anywhere.filter((r) => r[0] >= starts.at(-1));
  const known = present.length ? present : anywhere;
  const recent = known.slice(-Math.max(4, Math.ceil(known.length * 0.9)));
  const low = Math.min(...recent.map((r) => factor * (r[1] - 1.6 * WIDE * (r[2] || 0))));
  const high = Math.max(...recent.map((r) => factor * (r[1] + 1.6 * WIDE * (r[2] || 0))));
  traces.push({
    x, y, mode: "lines", line: { color: colour("accent"), width: 1.6 }, connectgaps: false,
    hovertemplate: "%{y:.4g}<extra></extra>",
  });
  const pad = 0.06 * (high - low) || 0.05 * Math.abs(high) || 1;
  draw(place, traces, {
    xaxis: timeAxis(over), yaxis: recent.length ? { range: [low - pad, high + pad] } : {},
    shapes: rules(starts, over.first, over.last, per),
  }, words);
}

/* 1, 2 and 5 of each decade that is shown; 1 alone where there are many. */
function decades(low, high) {
  const out = [];
  for (let k = Math.floor(low); k <= Math.ceil(high); k += 1) {
    for (const m of high - low > 2.2 ? [1] : [1, 2, 5]) out.push(Number((m * 10 ** k).toPrecision(6)));
  }
  return out;
}

/* One line an output, and the bounds that hold 99 %. */
function drawTests(place, all, names, which, bounds, starts, words) {
  const over = span(all), per = over.unit.per;
  const rows = broken(thin(all), starts);
  const x = rows.map((r) => r[0] / per);
  const traces = names.map((name, i) => ({
    x, y: rows.map((r) => (r[which] ? r[which][i] : null)), mode: rows.length < 80 ? "lines+markers" : "lines",
    marker: { size: 4 }, line: { color: colour(`s${i % 6}`), width: 1.3 },
    hovertemplate: `${plain(name).replace(/[%{}]/g, "")}: %{y:.3g}<extra></extra>`,
  }));
  const lines = bounds.filter((b) => b != null).map((b) => ({
    type: "line", xref: "paper", x0: 0, x1: 1, y0: b, y1: b, line: { color: colour("alarm"), width: 1.2, dash: "dash" },
  }));
  const values = rows.flatMap((r) => (r[which] || []).filter((v) => v > 0)).concat(bounds.filter((b) => b > 0));
  const range = values.length ? [Math.log10(Math.min(...values)) - 0.08, Math.log10(Math.max(...values)) + 0.08] : [0, 1];
  draw(place, traces, {
    xaxis: timeAxis(over), yaxis: range[1] - range[0] < 0.9 ? { range: range.map((v) => 10 ** v) }
      : { type: "log", range, tickvals: decades(...range), tickformat: "~g" },
    shapes: [...lines, ...rules(starts, over.first, over.last, per)],
  }, words);
}

/* values [output][channel][lag]; the root is coloured, so that small parameters are seen beside large ones. Under the
 * name of each output stands a row for each channel that it is predicted from. */
function drawMap(place, values, outputs, channels, entry) {
  const labels = [], z = [], told = [], count = channels.length + 1, lags = values[0][0].length;
  let most = 0;
  const root = (v) => (v == null ? null : Math.sign(v) * Math.sqrt(Math.abs(v)));
  values.forEach((row, o) => {
    labels.push(`<b>${plain(outputs[o])} from</b>`);
    z.push(Array(lags).fill(null));
    told.push(Array(lags).fill(""));
    row.forEach((numbers, c) => {
      labels.push(plain(channels[c]));
      numbers.forEach((v) => { most = Math.max(most, Math.abs(v || 0)); });
      z.push(numbers.map(root));
      told.push(numbers.map((v, lag) =>
        (v == null ? "" : `${plain(outputs[o])} from ${plain(channels[c])}, lag ${lag}: ${v.toPrecision(4)}`)));
    });
  });
  const top = Math.sqrt(most) || 1, ticks = [-1, -0.25, 0, 0.25, 1].map((part) => part * most);
  const at = entry ? entry[0] * count + 1 + entry[1] : -1;
  const chosen = entry ? [{
    type: "rect", x0: entry[2] - 0.5, x1: entry[2] + 0.5, y0: at - 0.5, y1: at + 0.5, line: { color: colour("ink"), width: 2 },
  }] : [];
  const high = Math.min(Math.max(labels.length * 16, 110), 620);
  place.style.height = `${high + 36}px`;
  draw(place, [{
    type: "heatmap", z, x0: 0, dx: 1, y0: 0, dy: 1, customdata: told, zmin: -top, zmax: top, xgap: 1, ygap: 1,
    colorscale: [[0, colour("low")], [0.5, colour("ground")], [1, colour("high")]], hoverongaps: false,
    hovertemplate: "%{customdata}<extra></extra>",
    colorbar: {
      thickness: 8, len: 1, outlinewidth: 0, tickvals: ticks.map(root),
      ticktext: ticks.map((v) => (v ? v.toPrecision(2) : "0")), tickfont: { size: 10, color: colour("soft") },
    },
  }], {
    xaxis: { title: { text: "lag (samples)", standoff: 4 }, showgrid: false, range: [-0.5, lags - 0.5], showline: false,
      nticks: Math.max(3, Math.round(place.clientWidth / 60)) },
    yaxis: {
      range: [labels.length - 0.5, -0.5], showgrid: false, showline: false, ticklen: 0, automargin: true,
      tickfont: { size: high < labels.length * 12 ? 8 : 10, color: colour("ink") }, tickvals: labels.map((_, i) => i), ticktext: labels,
    },
    margin: { l: 60, r: 4, t: 2, b: 34 }, shapes: chosen, hovermode: "closest", height: high + 36,
  }, `Map of ${values.length * channels.length} by ${lags} Markov parameters, largest ${most.toPrecision(3)}`);
  if (!place.dataset.picks) {
    place.dataset.picks = "1";
    const wait = setInterval(() => {
      if (!place.on) return;
      clearInterval(wait);
      place.on("plotly_click", (event) => {
        const [row, lag] = event.points[0].pointNumber;
        place.dispatchEvent(new CustomEvent("pick", { detail: { row, lag } }));
      });
    }, 200);
  }
}

function drawLoad(place, all) {
  const over = span(all), per = over.unit.per, rows = thin(all);
  const loads = rows.map((r) => 100 * r[1]);
  draw(place, [{
    x: rows.map((r) => r[0] / per), y: loads, mode: "lines", fill: "tozeroy", fillcolor: colour("band"),
    line: { color: colour("accent"), width: 1.4 }, hovertemplate: "%{y:.1f} %<extra></extra>",
  }], {
    xaxis: timeAxis(over), yaxis: { range: [0, Math.max(1, 1.15 * Math.max(0, ...loads))], title: { text: "%", standoff: 4 } },
  }, `Bus load over time, now ${loads.length ? loads[loads.length - 1].toFixed(1) : 0} %`);
}
