"use strict";
/* Put in the place of a still picture of lines over time one in which a stretch can be chosen and read.
   Without this script, and printed, the still picture stands. Text enters the page as text only. */

const SVG = "http://www.w3.org/2000/svg";
const LEFT = 62, RIGHT = 12, TOP = 20, GAP = 26, FOOT = 38; // around and between the panels, px
const LEAST = 4; // samples that are shown at the least
const MISSING = 65535;

function made(name, attributes = {}, text = null, space = null) {
  const node = space ? document.createElementNS(space, name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text !== null) node.textContent = text;
  return node;
}

const drawn = (name, attributes, text = null) => made(name, attributes, text, SVG);

function bytes(text) {
  return Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
}

/* Values are 16 bits of the line's own range; 65535 is a missing one. */
function values(line) {
  const codes = new DataView(bytes(line.data).buffer);
  return Float64Array.from({ length: codes.byteLength / 2 }, (_, k) => {
    const code = codes.getUint16(2 * k, true);
    return code === MISSING ? NaN : line.low + line.step * code;
  });
}

function times(clock) {
  if (!clock.data) return Float64Array.from({ length: clock.count }, (_, k) => clock.start + clock.step * k);
  const codes = new DataView(bytes(clock.data).buffer);
  return Float64Array.from({ length: codes.byteLength / 8 }, (_, k) => codes.getFloat64(8 * k, true));
}

/* Round steps of 1, 2 or 5 times a power of ten, at most so many in a range. */
function ticks(low, high, most) {
  const raw = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9 * step; k += 1) found.push(k * step);
  return { found, step };
}

/* As many digits as tell neighbouring values apart. */
function written(value, step) {
  const size = Math.max(Math.abs(value), Math.abs(step));
  if (size >= 1e6 || (size > 0 && size < 1e-3)) return value.toExponential(2).replace(/-/g, "\u2212");
  const digits = Math.min(Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)), 8);
  return (Math.abs(value) < 1e-9 * step ? 0 : value).toFixed(digits).replace("-", "\u2212");
}

/* The first place whose time is not before t. */
function placeOf(time, t) {
  let a = 0, b = time.length;
  while (a < b) {
    const middle = (a + b) >> 1;
    if (time[middle] < t) a = middle + 1;
    else b = middle;
  }
  return a;
}

class Chart {
  constructor(figure, facts) {
    this.figure = figure;
    this.time = times(facts.clock);
    this.panels = facts.panels.map((panel) => ({
      ...panel, lines: panel.lines.map((line) => ({ ...line, values: values(line) })),
    }));
    this.first = facts.view;
    this.view = [...facts.view];
    this.svg = drawn("svg", { tabindex: "0", role: "img", "aria-label": facts.title });
    this.told = made("div", { class: "told" });
    this.build();
    this.listen();
    // what is drawn changes the height alone: only a new width is drawn anew, and not while sizes are being settled
    new ResizeObserver(() => {
      if (this.box.clientWidth && this.box.clientWidth !== this.wide) requestAnimationFrame(() => this.draw());
    }).observe(this.box);
  }

  build() {
    const bar = made("div", { class: "bar" });
    const whole = [this.time[0], this.time[this.time.length - 1]];
    const moves = [
      ["\u2212", "show twice as long a stretch", () => this.scale(2)], ["+", "show half of it", () => this.scale(0.5)],
      ["\u25c2", "earlier", () => this.shift(-0.5)], ["\u25b8", "later", () => this.shift(0.5)],
      ["all", "show all", () => this.show(...whole)], ["first view", "as at first", () => this.show(...this.first)],
    ];
    for (const [text, title, act] of moves) {
      const button = made("button", { type: "button", title, "aria-label": title }, text);
      button.addEventListener("click", act);
      bar.append(button);
    }
    const most = this.panels.reduce((a, b) => (b.lines.length > a.lines.length ? b : a));
    for (const line of most.lines) {
      const key = made("span", { class: `key ${line.kind}` }, line.name);
      bar.append(key);
    }
    this.box = made("div", { class: "live" });
    this.box.append(bar, this.svg, this.told);
    this.figure.querySelector(".scroll").before(this.box);
    this.figure.classList.add("moves");
  }

  listen() {
    const at = (event) => event.clientX - this.svg.getBoundingClientRect().left;
    const down = (event) => event.clientY - this.svg.getBoundingClientRect().top;
    this.svg.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      this.from = at(event);
      this.svg.setPointerCapture(event.pointerId);
    });
    this.svg.addEventListener("pointermove", (event) => this.point(at(event), down(event)));
    this.svg.addEventListener("pointerup", (event) => {
      const ends = [this.from, at(event)].map((x) => this.timeAt(x)).sort((a, b) => a - b);
      const far = this.from !== null && Math.abs(at(event) - this.from) > 6;
      this.from = null;
      if (far) this.show(...ends);
      else this.point(at(event), down(event));
    });
    for (const gone of ["pointercancel", "pointerleave"]) {
      this.svg.addEventListener(gone, () => { this.from = null; this.point(null); });
    }
    this.svg.addEventListener("dblclick", () => this.show(this.time[0], this.time[this.time.length - 1]));
    const keys = { ArrowLeft: () => this.shift(-0.2), ArrowRight: () => this.shift(0.2), "+": () => this.scale(0.5),
      "-": () => this.scale(2), Home: () => this.show(...this.first) };
    this.svg.addEventListener("keydown", (event) => {
      if (!keys[event.key]) return;
      event.preventDefault();
      keys[event.key]();
    });
  }

  /* Show a stretch, within what there is and no shorter than a few samples. */
  show(from, to) {
    const time = this.time, last = time.length - 1;
    const least = Math.min(LEAST * (time[last] - time[0]) / last, time[last] - time[0]);
    const length = Math.min(Math.max(to - from, least), time[last] - time[0]);
    const start = Math.min(Math.max((from + to - length) / 2, time[0]), time[last] - length);
    this.view = [start, start + length];
    this.draw();
  }

  scale(factor) {
    const [a, b] = this.view;
    this.show((a + b - factor * (b - a)) / 2, (a + b + factor * (b - a)) / 2);
  }

  shift(share) {
    const by = share * (this.view[1] - this.view[0]);
    this.show(this.view[0] + by, this.view[1] + by);
  }

  timeAt(x) {
    const [a, b] = this.view;
    return a + (Math.min(Math.max(x, LEFT), this.width - RIGHT) - LEFT) / (this.width - LEFT - RIGHT) * (b - a);
  }

  xOf(t) {
    const [a, b] = this.view;
    return LEFT + (t - a) / (b - a) * (this.width - LEFT - RIGHT);
  }

  draw() {
    this.wide = this.box.clientWidth;
    this.width = Math.max(this.wide, 240);
    const heights = this.panels.map((p) => p.height), height = TOP + FOOT + GAP * (heights.length - 1)
      + heights.reduce((a, b) => a + b, 0);
    this.svg.setAttribute("viewBox", `0 0 ${this.width} ${height}`);
    this.svg.setAttribute("height", height);
    const parts = [];
    let top = TOP;
    this.panels.forEach((panel, k) => {
      parts.push(...this.panel(panel, top, k === heights.length - 1));
      top += panel.height + GAP;
    });
    this.mark = drawn("rect", { class: "mark", y: TOP, height: height - TOP - FOOT, width: 0 });
    this.cursor = drawn("path", { class: "cursor" });
    this.svg.replaceChildren(...parts, this.mark, this.cursor);
    this.bottom = height - FOOT;
    this.told.textContent = this.said();
  }

  /* Draw one panel: grid with its numbers, what the axis is, a line each. */
  panel(panel, top, isLast) {
    const [a, b] = this.range();
    const [low, high] = this.ends(panel, a, b);
    const yOf = (v) => top + panel.height * (1 - (v - low) / (high - low));
    const parts = [], bottom = top + panel.height;
    const up = ticks(low, high, panel.height / 28), along = ticks(...this.view, (this.width - LEFT - RIGHT) / 80);
    for (const v of up.found) {
      parts.push(drawn("path", { class: "grid", d: `M${LEFT} ${yOf(v)}H${this.width - RIGHT}` }));
      const place = { x: LEFT - 6, y: yOf(v) + 4, "text-anchor": "end" };
      parts.push(drawn("text", place, written(v, up.step)));
    }
    for (const t of along.found) {
      parts.push(drawn("path", { class: "grid", d: `M${this.xOf(t)} ${top}V${bottom}` }));
      const place = { x: this.xOf(t), y: bottom + 16, "text-anchor": "middle" };
      if (isLast) parts.push(drawn("text", place, written(t, along.step)));
    }
    const middle = { x: LEFT + (this.width - LEFT - RIGHT) / 2, y: bottom + 33, "text-anchor": "middle" };
    if (isLast) parts.push(drawn("text", middle, "time (s)"));
    parts.push(drawn("text", { x: LEFT, y: top - 7 }, panel.title));
    for (const line of panel.lines) {
      parts.push(drawn("path", { class: line.kind, d: this.path(line.values, a, b, yOf) }));
    }
    return parts;
  }

  /* The places of the samples in view, one more on either side. */
  range() {
    const [from, to] = this.view;
    return [Math.max(placeOf(this.time, from) - 1, 0), Math.min(placeOf(this.time, to) + 1, this.time.length)];
  }

  ends(panel, a, b) {
    let low = Infinity, high = -Infinity;
    for (const line of panel.lines) {
      for (let k = a; k < b; k += 1) {
        if (line.values[k] < low) low = line.values[k];
        if (line.values[k] > high) high = line.values[k];
      }
    }
    if (!(low <= high)) return [0, 1];
    const room = 0.05 * (high - low) || 0.05 * Math.abs(high) || 1;
    return [low - room, high + room];
  }

  /* A line of what is in view: of the samples of one pixel the first, the least, the greatest, the last. */
  path(v, a, b, yOf) {
    const parts = [], put = (k, pen) => parts.push(`${pen}${this.xOf(this.time[k]).toFixed(1)} ${yOf(v[k]).toFixed(1)}`);
    const each = Math.max(1, Math.floor((b - a) / (this.width - LEFT - RIGHT)));
    const step = (this.time[this.time.length - 1] - this.time[0]) / (this.time.length - 1);
    let pen = "M", last = -Infinity;
    for (let k = a; k < b; k += each) {
      const own = [];
      for (let i = k; i < Math.min(k + each, b); i += 1) {
        if (Number.isNaN(v[i])) continue;
        own.push(i);
      }
      if (!own.length) { pen = "M"; continue; }
      if (this.time[own[0]] - last > (each + 0.5) * step) pen = "M";
      const least = own.reduce((p, q) => (v[q] < v[p] ? q : p)), most = own.reduce((p, q) => (v[q] > v[p] ? q : p));
      for (const i of [...new Set([own[0], least, most, own[own.length - 1]])].sort((p, q) => p - q)) {
        put(i, pen);
        pen = "L";
      }
      last = this.time[own[own.length - 1]];
    }
    return parts.join("");
  }

  /* Follow the pointer: the values below it, or the stretch that is being chosen. */
  point(x, y) {
    if (x === null || x < LEFT || x > this.width - RIGHT) {
      this.cursor.setAttribute("d", "");
      this.mark.setAttribute("width", 0);
      this.told.textContent = this.said();
      return;
    }
    const inside = Math.min(Math.max(x, LEFT), this.width - RIGHT);
    if (this.from !== null && this.from !== undefined) {
      const start = Math.min(Math.max(this.from, LEFT), this.width - RIGHT);
      this.mark.setAttribute("x", Math.min(start, inside));
      this.mark.setAttribute("width", Math.abs(inside - start));
    } else this.mark.setAttribute("width", 0);
    const k = this.nearest(this.timeAt(inside));
    this.cursor.setAttribute("d", `M${this.xOf(this.time[k])} ${TOP}V${this.bottom}`);
    const panel = this.panelAt(y), told = panel.lines.map((line) => `${line.name} ${this.figures(line.values[k], line.step)}`);
    this.told.textContent = `${this.stamp(this.time[k])}, ${panel.title}: ${told.join(", ")}`;
  }

  nearest(t) {
    const k = Math.min(placeOf(this.time, t), this.time.length - 1);
    return k > 0 && t - this.time[k - 1] < this.time[k] - t ? k - 1 : k;
  }

  /* The panel at a height, the nearest above one between two. */
  panelAt(y) {
    let top = TOP;
    for (const panel of this.panels) {
      top += panel.height + GAP;
      if (y < top) return panel;
    }
    return this.panels[this.panels.length - 1];
  }

  figures(value, step) {
    return Number.isNaN(value) ? "missing" : written(value, Math.max(step, 1e-4 * Math.abs(value)));
  }

  stamp(t) {
    return `${written(t, (this.time[this.time.length - 1] - this.time[0]) / this.time.length)} s`;
  }

  said() {
    const [a, b] = this.view;
    return `Shown: ${this.stamp(a)} to ${this.stamp(b)} of ${this.stamp(this.time[0])} to `
      + `${this.stamp(this.time[this.time.length - 1])}. Drag across a stretch to see it alone; a double click shows all.`;
  }
}

for (const figure of document.querySelectorAll("figure[data-lines]")) {
  try {
    new Chart(figure, JSON.parse(figure.dataset.lines)).draw();
  } catch (error) {
    figure.classList.remove("moves"); // the still picture stands
    console.error(error);
  }
}
