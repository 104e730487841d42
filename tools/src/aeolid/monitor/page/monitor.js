"use strict";
/* Ask once a second what is new, and show it. Text from the bus enters the page as text only. */

const EVERY_MS = 1000, FIRST_MS = 300, PATIENCE_MS = 8000, ROWS = 2500;
const MODES = ["Mode", "Frequency (Hz)", "95 %", "Damping (%)", "95 %", "Mostly in", "Name"];
const TESTS = ["", "Std of e", "Whiteness Q", "Variance s²/s₀²", "Outside 99 %: Q, s²"];
const $ = (id) => document.getElementById(id);
const state = {
  process: "", node: null, facts: null, key: "", entry: null, starts: [0], matrix: null, span: "",
  count: { bus: 0, modes: 0, tests: 0, thetas: 0, matrix: 0 }, rows: { bus: [], modes: [], tests: [], thetas: [] },
  heard: null, polls: 0,
};

function element(name, text, attributes = {}) {
  const made = document.createElement(name);
  if (text != null) made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

/* A name that may be broken after its underscores. */
function named(made, text) {
  text.split(/(?<=_)/).forEach((part) => made.append(part, document.createElement("wbr")));
  return made;
}

/* Change what is there only where it differs: selections and focus stay. */
function put(parent, wanted) {
  if (parent.dataset.told === JSON.stringify(wanted.map((w) => w.outerHTML))) return;
  parent.dataset.told = JSON.stringify(wanted.map((w) => w.outerHTML));
  parent.replaceChildren(...wanted);
}

function forget(names) {
  for (const name of names) {
    state.count[name] = 0;
    if (state.rows[name]) state.rows[name] = [];
  }
}

function question() {
  const q = new URLSearchParams({ process: state.process, node: state.node ?? -1, ...state.count });
  if (state.entry) q.set("entry", state.entry.join(","));
  return `state?${q}`;
}

async function ask() {
  const answer = await fetch(question(), { signal: AbortSignal.timeout(PATIENCE_MS), cache: "no-store" });
  if (!answer.ok) throw new Error(`the monitor answers ${answer.status}`);
  return answer.json();
}

async function poll() {
  const asked = { node: state.node, entry: String(state.entry) };
  try {
    const told = await ask();
    state.heard = new Date();
    take(told, asked);
    contact(true);
    show();
    document.body.dataset.polls = ++state.polls;
  } catch (error) {
    if (!(error instanceof TypeError || error instanceof DOMException || /answers/.test(error.message))) throw error;
    contact(false);
  } finally {
    setTimeout(poll, state.polls < 4 ? FIRST_MS : EVERY_MS);
  }
}

function take(told, asked) {
  if (told.process !== state.process) {
    state.process = told.process;
    state.polls = 0;
    state.key = "";
    forget(["bus", "modes", "tests", "thetas", "matrix"]);
    state.matrix = null;
  }
  state.facts = told.facts;
  const numbers = told.facts.nodes.map((n) => n.node);
  if (!numbers.includes(state.node)) choose(numbers.length ? numbers[0] : null);
  const s = told.series;
  merge("bus", s.bus);
  if (s.node == null || asked.node !== state.node) return;
  if (s.key !== state.key) {
    const first = state.key === "" && [s.modes, s.tests].every((part) => part.fresh);
    state.key = s.key;
    if (!first) { /* another configuration: what was counted before is of the one before */
      forget(["modes", "tests", "thetas", "matrix"]);
      state.entry = null;
      return;
    }
  }
  state.starts = s.starts;
  merge("modes", s.modes);
  merge("tests", s.tests);
  if (s.matrix) {
    state.matrix = s.matrix.values;
    state.count.matrix = s.matrix.count;
  }
  if (s.thetas && asked.entry === String(state.entry)) {
    if (String(s.entry) !== String(state.entry)) state.rows.thetas = [];
    state.entry = s.entry;
    merge("thetas", s.thetas);
  }
}

function merge(name, part) {
  if (!part) return;
  state.rows[name] = part.fresh ? part.rows : state.rows[name].concat(part.rows);
  state.count[name] = state.rows[name].length > ROWS ? 0 : part.count;
}

function choose(node) {
  state.node = node;
  state.key = "";
  state.entry = null;
  state.matrix = null;
  forget(["modes", "tests", "thetas", "matrix"]);
}

function contact(there) {
  document.body.classList.toggle("stale", !there);
  const place = $("contact");
  let tone = "good", text = "receiving";
  const since = state.heard ? state.heard.toLocaleTimeString() : null;
  if (!there) {
    tone = "alarm";
    text = since ? `no monitor since ${since}: ended, or being restarted; asking again` : "no monitor; asking again";
    if (state.facts && state.facts.over) text = `ended at ${since}; this page wakes when a monitor runs here again`;
  } else if (state.facts.over) [tone, text] = ["wait", "the reception is over"];
  else if (state.facts.ended) [tone, text] = ["wait", "all nodes have ended"];
  else if (state.facts.bus.status) [tone, text] = ["alarm", "no bus"];
  else if (!state.facts.nodes.length) [tone, text] = ["wait", "waiting for a node"];
  place.dataset.tone = tone;
  if (place.textContent !== text) place.textContent = text;
}

function duration(seconds) {
  const s = Math.floor(seconds);
  if (s < 120) return `${s} s`;
  const m = Math.floor(s / 60);
  return m < 60 ? `${m} min ${String(s % 60).padStart(2, "0")} s` : `${Math.floor(m / 60)} h ${String(m % 60).padStart(2, "0")} min`;
}

function facts(parent, pairs) {
  put(parent, pairs.filter((p) => p[1] !== "" && p[1] != null).map(([name, value, tone]) => {
    const made = element("div");
    if (tone) made.dataset.tone = tone;
    made.append(element("dt", name), element("dd", value, String(value).length > 14 ? { class: "long" } : {}));
    return made;
  }));
}

function show() {
  const { bus, nodes, findings, events } = state.facts;
  document.title = `${findings.some((f) => f.level === "alarm") ? "! " : ""}aeolid monitor`;
  if ($("source").textContent !== bus.source) $("source").textContent = bus.source;
  const troubles = [[bus.damaged, "damaged"], [bus.garbled, "garbled"], [bus.errors, "error frames"], [bus.overrun, "dropped"]];
  facts($("strip"), [
    ["Listening for", duration(bus.seconds)], ["Frames", bus.frames.toLocaleString("en")],
    ["Frames a second", bus.frames_per_s.toFixed(0)], ["Bus load, at most", `${(100 * bus.load).toFixed(1)} %`],
    ["Disturbances", troubles.filter((t) => t[0]).map((t) => t.join(" ")).join(", ") || "none"],
    ["Interruptions", bus.interruptions || ""], ["Recording to", bus.recording || ""], ["Raw log", bus.log ? bus.log.file : ""],
  ]);
  put($("findings"), findings.map((f) => {
    const made = element("div", null, { class: `finding ${f.level}` });
    made.append(element("b", (f.node == null ? "" : `Node ${f.node}: `) + f.what), " ", element("span", f.remedy));
    return made;
  }));
  const tones = { running: "good", ended: "wait", silent: "alarm", waiting: "wait", problem: "alarm" };
  put($("tabs"), nodes.map((n) => element("button", `Node ${n.node}`, {
    role: "tab", type: "button", "data-node": n.node, "data-tone": tones[n.state], "aria-controls": "node",
    "aria-selected": String(n.node === state.node), tabindex: n.node === state.node ? "0" : "-1",
    title: n.state === "problem" ? "cannot be read" : n.state,
  })));
  put($("events"), [...events].reverse().map((e) => {
    const made = element("li");
    made.append(element("time", e.at), element("span", e.text));
    return made;
  }));
  showNode(nodes.find((n) => n.node === state.node));
}

function showNode(n) {
  $("node").classList.toggle("empty", !n || !n.described);
  if (!n || !n.described) {
    $("waiting").textContent = !n ? "Waiting for a node." : n.problem || "Waiting for the node's description of itself.";
    return;
  }
  const s = n.snapshots;
  $("node").setAttribute("aria-label", `Node ${n.node}`);
  facts($("about"), [
    ["State", n.state + (n.runs > 1 ? `, run ${n.runs}` : "")], ["Samples", n.samples.toLocaleString("en")],
    ["Values lost", `${n.lost.toLocaleString("en")} (${(100 * n.lost_share).toFixed(2)} %)`, n.lost_share >= 0.01 ? "alarm" : ""],
    ["Snapshots", `${s.complete}${s.incomplete ? ` + ${s.incomplete} incomplete` : ""}`],
    ["Newest snapshot", s.age_s == null ? "none yet" : `${duration(s.age_s)} old`],
    ["Filter", `${n.method}, ${n.model_set}, p = ${n.past}, λ = ${n.forgetting}, ρ = ${n.regularisation}`],
    ["Sample time", `${n.sample_time_s} s`], ["Order", n.order || ""],
    ["Inputs", n.inputs.join(", ") || "none: outputs alone"], ["Outputs", n.outputs.join(", ")], ["Clock", n.clock],
  ]);
  showModes(n);
  showTests(n);
  showParameters(n);
  const up = Object.entries(n.health).filter(([flag]) => n.flags & Number(flag)).map(([, text]) => text);
  put($("flags"), (up.length ? up : ["no flag raised"]).map((text) =>
    element("li", text[0].toUpperCase() + text.slice(1), { "data-tone": up.length ? "alarm" : "good" })));
  facts($("counters"), Object.entries(n.counters).filter(([name]) => name !== "SampleIndex")
    .map(([name, value]) => [name.replace(/(.)([A-Z])/g, "$1 $2").toLowerCase(), value.toLocaleString("en")]));
  drawLoad($("load"), within(state.rows.bus, state.span));
}

/* One row of a table; its labels stand before the cells where the page is narrow. */
function cells(row, labels, values, classes = {}) {
  row.setAttribute("role", "row");
  values.forEach((value, i) => {
    const made = element(i ? "td" : "th", null, { "data-label": labels[i], role: i ? "cell" : "rowheader" });
    if (!i) made.setAttribute("scope", "row");
    if (classes[i]) made.className = classes[i];
    row.append(named(made, String(value)));
  });
  return row;
}

/* Numbers of modes hold within a run; of one before, the mode is meant whose pole is nearest, if that is near. */
function nearest(rows, mode) {
  const pole = (f, d) => [-d * f, f * Math.sqrt(Math.max(0, 1 - d * d))];
  const [a, b] = pole(mode.frequency_hz, mode.damping);
  let best = null, least = 0.25;
  for (const row of rows) {
    const [c, d] = pole(row[1], row[3]);
    const far = Math.hypot(a - c, b - d) / Math.max(mode.frequency_hz, row[1], 1e-12);
    if (far <= least) [best, least] = [row, far];
  }
  return best;
}

function showModes(n) {
  put($("modes-table").tBodies[0], n.modes.map((m) => cells(element("tr", null, { "data-mode": m.mode }), MODES, [
    m.mode, m.frequency, m.frequency_95, m.damping_percent, m.damping_95, m.mostly_in, m.name,
  ])));
  $("modes-note").textContent = [
    n.modes_waiting ? `No modes yet: ${n.modes_waiting}.`
      : !n.modes.length ? "No oscillating mode." : n.modes_note ? `Deviations not known: ${n.modes_note}.` : "",
    n.harmonics ? `Harmonics of the rotor or other steady sines: ${n.harmonics}.` : "",
  ].join(" ").trim();
  const place = $("strips"), wanted = n.modes.map((m) => String(m.mode));
  for (const old of [...place.children]) if (!wanted.includes(old.dataset.mode)) old.remove();
  const rows = within(state.rows.modes, state.span), begun = state.starts.at(-1);
  n.modes.forEach((m, i) => {
    for (const [kind, column, unit, text, factor] of [["frequency", 1, "Hz", m.frequency, 1], ["damping", 3, "%", m.damping_percent, 100]]) {
      const id = `${kind}-${m.mode}`;
      let figure = $(id);
      if (!figure) {
        figure = element("figure", null, { id, "data-mode": m.mode });
        figure.append(element("figcaption"), element("div", null, { class: "plot", role: "img" }));
      }
      const at = 2 * i + (kind === "damping" ? 1 : 0);
      if (place.children[at] !== figure) place.insertBefore(figure, place.children[at] || null);
      const caption = figure.firstChild, words = `Mode ${m.mode}, ${kind}`;
      caption.replaceChildren(`${words} `, element("b", `${text} ${unit}`));
      const line = rows.map((r) => {
        const found = r[0] < begun ? nearest(r[1], m) : r[1].find((x) => x[0] === m.mode);
        return found ? [r[0], found[column], found[column + 1]] : [r[0], null, null];
      });
      drawBand(figure.lastChild, line, state.starts, `${words} over time, now ${text} ${unit}`, factor);
    }
  });
}

function showTests(n) {
  const t = n.innovations;
  put($("tests-table").tBodies[0], t.rows.map((r, i) => {
    const row = cells(element("tr"), TESTS, [
      r.output, `${r.deviation} ${r.unit}`, r.whiteness, r.ratio, `${r.outside[0]}, ${r.outside[1]}`,
    ], { 2: r.now[0] ? "out" : "in", 3: r.now[1] ? "out" : "in" });
    row.firstChild.prepend(element("i", null, { class: `swatch s${i % 6}`, "aria-hidden": "true" }));
    return row;
  }));
  $("q-head").textContent = t.bound == null ? "" : `below ${t.bound.toFixed(1)}`;
  $("f-head").textContent = t.high == null ? "" : `${t.low.toFixed(2)} … ${t.high.toFixed(2)}`;
  $("o-head").textContent = t.blocks ? `Q, s² of ${t.blocks} blocks` : "";
  $("tests-note").textContent = t.waiting ? `No test yet: ${t.waiting}.` : t.caution ? `Caution: ${t.caution}.` : "";
  const rows = within(state.rows.tests, state.span);
  for (const id of ["whiteness", "variance"]) $(id).parentElement.hidden = !rows.length;
  if (!rows.length) return;
  drawTests($("whiteness"), rows, n.outputs, 1, [t.bound], state.starts, "Ljung–Box statistic of each output over time");
  drawTests($("variance"), rows, n.outputs, 2, [t.low || null, t.high], state.starts, "Ratio of variances of each output over time");
}

function options(select, texts, chosen) {
  put(select, texts.map((text, i) => element("option", text, { value: i })));
  if (document.activeElement !== select) select.value = String(chosen);
}

function showParameters(n) {
  $("parameters").hidden = !state.matrix;
  if (!state.matrix || !state.entry) return;
  const [output, channel, lag] = state.entry;
  options($("pick-output"), n.outputs, output);
  options($("pick-channel"), n.block, channel);
  options($("pick-lag"), Array.from({ length: n.past + 1 }, (_, i) => String(i)), lag);
  drawMap($("map"), state.matrix, n.outputs, n.block, state.entry);
  const value = state.matrix[output]?.[channel]?.[lag];
  $("theta-words").replaceChildren(`${n.outputs[output]} from ${n.block[channel]}, lag ${lag} `, element("b", value == null ? "" : value.toPrecision(4)));
  drawBand($("theta"), within(state.rows.thetas, state.span).map((r) => [r[0], r[1], null]), state.starts,
    `Markov parameter of ${n.outputs[output]} from ${n.block[channel]} at lag ${lag} over time, now ${value ?? "none"}`);
}

function pick(output, channel, lag) {
  if (state.matrix?.[output]?.[channel]?.[lag] == null) return;
  state.entry = [output, channel, lag];
  forget(["thetas"]);
}

$("map").addEventListener("pick", (event) => {
  const count = state.matrix[0].length + 1, { row, lag } = event.detail; /* the first row bears the output's name */
  if (row % count) pick(Math.floor(row / count), row % count - 1, lag);
});
for (const id of ["pick-output", "pick-channel", "pick-lag"]) {
  $(id).addEventListener("change", () => pick(...["output", "channel", "lag"].map((name) => Number($(`pick-${name}`).value))));
}
$("tabs").addEventListener("click", (event) => {
  const tab = event.target.closest("[data-node]");
  if (!tab) return;
  choose(Number(tab.dataset.node));
  show();
});
$("tabs").addEventListener("keydown", (event) => {
  const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  const tabs = [...$("tabs").children], at = tabs.findIndex((t) => t.getAttribute("aria-selected") === "true");
  if (!step || at < 0) return;
  choose(Number(tabs[(at + step + tabs.length) % tabs.length].dataset.node));
  show();
  $("tabs").querySelector("[aria-selected=true]").focus();
});
$("span").addEventListener("change", (event) => {
  state.span = event.target.value;
  if (state.facts) show();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (state.facts) show(); });
poll();
