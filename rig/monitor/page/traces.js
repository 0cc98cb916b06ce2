// The last minutes as on a chart recorder: least and greatest value of every tenth of a second.

import { number, quantity, readable } from "./format.js";
import { faint, ink } from "./palette.js";
import { around, axis, place, plot, ticks, widthOf } from "./plot.js";

const NARROWEST = 58; // pixels of the numbers on the left
const KEPT = 3000; // bins: five minutes of a test by the clock
// Chosen by a button: a list that opens would be closed by Esc, which is the key of STOP.
const SPANS = [
  { seconds: 30, name: "30 s" },
  { seconds: 120, name: "2 min" },
  { seconds: 300, name: "5 min" },
];
const LOCKED = 2;
const ARMED = 1;
const STRIPS = [
  { key: "frequency_hz", name: "frequency", unit: "Hz", digits: 6, narrowest: 0.01, ink: "text" },
  { key: "phase_error_deg", name: "phase error", unit: "°", digits: 3, narrowest: 1, ink: "text" },
  { key: "force", name: "force", role: "force", ink: "force" },
  { key: "drive", name: "response", role: "drive", ink: "response" },
  { key: "voltage_v", name: "drive voltage", unit: "V", ink: "output", fromZero: true },
];

export class Traces {
  every = 200;

  constructor(parent, span) {
    this.span = SPANS[1];
    this.hover = null;
    this.widths = new Map();
    this.clear();
    this.strips = STRIPS.map((strip, index) => this.make(parent, strip, index === STRIPS.length - 1));
    span.addEventListener("click", () => {
      this.span = SPANS[(SPANS.indexOf(this.span) + 1) % SPANS.length];
      span.textContent = `last ${this.span.name}`;
      this.draw();
    });
  }

  clear() {
    this.time = [];
    this.lock = [];
    this.bands = STRIPS.map(() => [[], []]);
    this.part = null;
    this.offset = this.last = 0;
  }

  reset({ facts }) {
    this.clear();
    if (!facts) return;
    for (const strip of this.strips) {
      const channel = facts.channels.find((one) => one.role === strip.role);
      if (channel) strip.unit = readable(channel.unit);
    }
  }

  take({ bins }) {
    if (!bins) return;
    const { end_s: end } = bins;
    for (let index = 0; index < end.length; index++) {
      if (bins.part[index] !== this.part) {
        this.offset = this.part === null ? 0 : this.last; // a further part begins at 0 again: it is drawn behind the last
        this.part = bins.part[index];
      }
      this.last = end[index] + this.offset;
      this.time.push(this.last);
      this.lock.push(bins.guard[index] === ARMED && bins.lock[index] !== LOCKED);
      this.bands.forEach((band, number) => {
        const values = bins[STRIPS[number].key];
        band[0].push(values[0][index]);
        band[1].push(values[1][index]);
      });
    }
    const over = this.time.length - KEPT;
    if (over > 0) for (const list of [this.time, this.lock, ...this.bands.flat()]) list.splice(0, over);
  }

  make(parent, given, lowest) {
    const strip = { ...given };
    const element = document.createElement("div");
    element.className = lowest ? "strip lowest" : "strip";
    const head = document.createElement("p");
    head.innerHTML = "<span></span> <b></b>";
    head.firstChild.textContent = strip.name;
    strip.reading = head.lastChild;
    element.append(head);
    parent.append(element);
    const canvas = place(element, "canvas", `${strip.name} over time`);
    canvas.id = `canvas-${strip.key.split("_")[0]}`;
    const line = { stroke: () => ink[strip.ink], width: 1.2, points: { show: false } };
    strip.plot = plot(canvas, {
      padding: [6, 8, lowest ? 0 : 6, 0],
      scales: { x: { time: false, range: () => this.range() }, y: { range: (_, low, high) => this.rangeOf(strip, low, high) } },
      axes: [
        axis({ size: lowest ? 22 : 0, values: (_, values) => (lowest && this.time.length ? values.map(clock) : []) }),
        axis({ size: (_, texts) => this.width(strip, texts), space: 22, values: (made, all) => (this.time.length ? ticks(made, all) : []) }),
      ],
      series: [{}, line, line],
      bands: [{ series: [1, 2], fill: () => faint(ink[strip.ink], 0.45) }],
      cursor: { y: false, points: { show: false }, drag: { x: false }, sync: { key: "traces" } },
      hooks: { drawClear: [(made) => this.shade(made)], setCursor: [(made) => this.point(made)] },
    });
    return strip;
  }

  /** Width of the numbers on the left: that of the longest of all strips, so that they stand over one another. */
  width(strip, texts) {
    this.widths.set(strip.key, widthOf(texts, NARROWEST));
    return Math.max(...this.widths.values());
  }

  range() {
    const span = this.span.seconds;
    return [Math.max(this.last - span, this.time[0] ?? 0), Math.max(this.last, (this.time[0] ?? 0) + Math.min(span, 10))];
  }

  rangeOf(strip, low, high) {
    if (low == null) return [0, 1];
    return strip.fromZero ? [0, Math.max(high * 1.08, 1e-3)] : around(low, high, strip.narrowest);
  }

  /** Hatch where the loop was not locked. */
  shade(made) {
    const { ctx, bbox } = made;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.fillStyle = hatch();
    const [from, to] = this.range();
    for (let index = 0; index < this.time.length; index++) {
      if (!this.lock[index]) continue;
      let end = index;
      while (end + 1 < this.time.length && this.lock[end + 1]) end++;
      const start = index ? this.time[index - 1] : this.time[0];
      if (this.time[end] >= from && start <= to) {
        const left = made.valToPos(Math.max(start, from), "x", true);
        ctx.fillRect(left, bbox.top, made.valToPos(this.time[end], "x", true) - left, bbox.height);
      }
      index = end;
    }
    ctx.restore();
  }

  point(made) {
    const index = made.cursor.idx;
    if (index === this.hover) return;
    this.hover = index;
    this.read();
  }

  read() {
    const index = this.hover ?? this.time.length - 1;
    this.strips.forEach((strip, number) => {
      const [low, high] = this.bands[number].map((band) => band[index]);
      const symmetric = strip.role !== undefined;
      const value = symmetric ? Math.max(Math.abs(low), Math.abs(high)) : (low + high) / 2;
      const shown = strip.fromZero ? high : value;
      const when = this.hover == null ? "" : ` at ${clock(this.time[index])}`;
      const text = low == null ? "–" : `${symmetric ? "±" : ""}${quantity(shown, strip.unit, strip.digits ?? 4)}${when}`;
      if (strip.reading.textContent !== text) strip.reading.textContent = text;
    });
  }

  draw() {
    if (this.hover != null && this.hover >= this.time.length) this.hover = null;
    this.strips.forEach((strip, number) => strip.plot.setData([this.time, this.bands[number][1], this.bands[number][0]]));
    this.read();
  }

  recolour() {
    for (const strip of this.strips) strip.plot.redraw(false, true);
  }
}

const clock = (seconds) => {
  const minutes = Math.floor(seconds / 60);
  const rest = number(seconds - 60 * minutes, seconds % 1 ? 3 : 2).split(".");
  return `${minutes}:${rest[0].padStart(2, "0")}${rest[1] && Number(rest[1]) ? `.${rest[1].replace(/0+$/, "")}` : ""}`;
};

let pattern = null;

/** Oblique lines, which are seen without their colour. */
function hatch() {
  if (pattern?.colour === ink.hatch) return pattern.fill;
  const tile = new OffscreenCanvas(8, 8);
  const draw = tile.getContext("2d");
  draw.strokeStyle = ink.hatch;
  draw.lineWidth = 1.5;
  draw.beginPath();
  for (const shift of [-8, 0, 8]) {
    draw.moveTo(shift, 8);
    draw.lineTo(shift + 8, 0);
  }
  draw.stroke();
  pattern = { colour: ink.hatch, fill: draw.createPattern(tile, "repeat") };
  return pattern.fill;
}
