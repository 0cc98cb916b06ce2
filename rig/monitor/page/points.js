// The points of the run: a table that grows, and the plot that its kind of test yields.

import { number, patterned, readable } from "./format.js";
import { faint, ink } from "./palette.js";
import { around, axis, place, plot, ticks } from "./plot.js";

const ROWS = 200; // of the table, the last ones
const KEPT = 5000; // points of the plot, the last ones
const LIMITS_95 = 1.96;

/** What is drawn for each kind of test: abscissa and two ordinates, keys of a point. */
const PLOTS = {
  backbone: ["amplitude_m", "frequency_hz", "damping_ratio"],
  "continuous-backbone": ["amplitude_m", "frequency_hz", "damping_ratio"],
  "stepped-phase": ["frequency_hz", "amplitude_m", "phase_lag_deg"],
  "stepped-sine": ["frequency_hz", "amplitude_m", "phase_lag_deg"],
  "response-controlled": ["frequency_hz", "force_n", "asked_phase_lag_deg"],
  sweep: ["level", "peak_m", "peak_frequency_hz"],
  multisine: ["number", "force_rms_n", "drive_rms_m_s2"],
  dwell: ["cycles", "frequency_hz", "damping_ratio"],
};
/** Standard error of a quantity, if the point has it, in the unit of the point. */
const ERRORS = {
  frequency_hz: "modal_frequency_std_hz",
  modal_frequency_hz: "modal_frequency_std_hz",
  damping_ratio: "damping_ratio_std",
  amplitude_m: "amplitude_std_m",
  force_n: "force_std_n",
};
/** Where the present state has what is drawn: key of the frame and factor. */
const PRESENT = { amplitude_m: "displacement_mm", frequency_hz: "frequency_hz", force_n: "force_n" };

export class Points {
  every = 250;

  constructor(parent, table, hint) {
    this.hint = hint;
    [this.head, this.body] = [table.tHead, table.tBodies[0]];
    this.scroll = table.parentElement;
    this.plots = [0, 1].map((which) => this.make(place(parent, "canvas", "Points"), which));
    this.clear();
  }

  clear() {
    this.points = new Map();
    this.earlier = [];
    this.rows = new Map();
    this.fresh = [];
    this.present = null;
    this.axes = [];
  }

  reset({ facts, earlier }) {
    this.clear();
    this.body.replaceChildren();
    this.head.replaceChildren();
    this.facts = facts;
    if (!facts) return;
    const level = { key: "level", heading: "level", unit: facts.level_unit, pattern: ".4g", scale: 1 };
    const name = { key: "number", heading: "point", unit: "", pattern: "d", scale: 1, counts_from: 1 };
    if (level.unit === "m") Object.assign(level, { unit: "mm", scale: 1e3 });
    this.columns = [name, level, ...facts.columns];
    this.shown = [name, level, ...facts.columns.filter((column) => column.in_line)];
    const told = facts.columns.filter((column) => !column.optional).map((column) => column.key);
    const keys = PLOTS[facts.kind] ?? ["number", ...told.slice(0, 2)];
    this.axes = keys.map((key) => this.columns.find((column) => column.key === key) ?? name);
    this.earlier = (earlier?.lines ?? []).filter((line) => line.is === "point" && line.accepted).map((line) => this.slim(line));
    this.head.append(headings([...this.shown.map(title), "quality"]));
    this.plots.forEach((made, which) => made.root.parentElement.setAttribute("aria-label", `${title(this.axes[which + 1])} over ${title(this.axes[0])}`));
    this.changed = true;
  }

  /** Keep of a point what is shown: a week of them must fit. */
  slim(line) {
    const kept = { number: line.number, quality: line.quality, accepted: line.accepted, errors: {} };
    for (const { key, scale, counts_from: first = 0 } of this.columns) {
      const value = line[key];
      kept[key] = typeof value === "number" ? value * scale + first : null;
      const error = line[ERRORS[key]];
      if (typeof error === "number") kept.errors[key] = LIMITS_95 * error * scale;
    }
    return kept;
  }

  take({ frame, lines }) {
    this.frame = frame;
    for (const line of lines ?? []) {
      if (line.is !== "point") continue;
      const point = this.slim(line);
      this.points.delete(point.number); // measured again: it takes the place of the earlier one
      this.points.set(point.number, point);
      this.fresh.push(point);
      if (this.points.size > KEPT) this.points.delete(this.points.keys().next().value);
    }
    if (this.fresh.length > ROWS) this.fresh.splice(0, this.fresh.length - ROWS);
  }

  draw() {
    if (!this.facts) return;
    if (this.fresh.length) this.drawTable();
    const present = this.live();
    const moved = JSON.stringify(present) !== JSON.stringify(this.present);
    this.present = present;
    if (this.changed || moved) this.plots.forEach((made, which) => this.fit(made, which));
    this.changed = false;
    const refused = [...this.points.values()].filter((point) => !point.accepted).length;
    const over = this.earlier.length ? `; grey: ${this.earlier.length} of an earlier run` : "";
    const bad = refused ? `, ${refused} not accepted` : "";
    const text = `${this.points.size} of ${this.facts.points}${bad}: ● good ○ warned ✕ refused + now${over}`;
    if (this.hint.textContent !== text) this.hint.textContent = text;
  }

  drawTable() {
    this.changed = true;
    const below = this.scroll.scrollTop + this.scroll.clientHeight >= this.scroll.scrollHeight - 30;
    for (const point of this.fresh) {
      this.rows.get(point.number)?.remove();
      const row = document.createElement("tr");
      row.dataset.quality = point.accepted ? point.quality : "refused";
      const texts = [...this.shown.map((column) => patterned(point[column.key], column.pattern)), `${mark(point)} ${point.quality}`];
      row.append(...texts.map((text) => cell("td", text)));
      this.body.append(row);
      this.rows.delete(point.number);
      this.rows.set(point.number, row);
    }
    for (const [number, row] of this.rows) {
      if (this.rows.size <= ROWS) break;
      row.remove();
      this.rows.delete(number);
    }
    this.fresh = [];
    if (below) this.scroll.scrollTop = this.scroll.scrollHeight;
  }

  /** The present state in the coordinates of the plots, while the rig is driven. */
  live() {
    if (!this.frame || this.frame.output_off || !this.frame.frequency_hz) return null;
    return this.axes.map(({ key }) => this.frame[PRESENT[key]] ?? null);
  }

  make(element, which) {
    const lowest = which === 1;
    return plot(element, {
      padding: [8, 12, lowest ? 0 : 4, 0],
      scales: { x: { time: false, range: () => this.extent[0] }, y: { range: () => this.extent[which + 1] } },
      axes: [
        axis({ size: lowest ? 22 : 8, label: lowest ? () => this.title(0) : undefined, labelSize: lowest ? 16 : 0, space: 60, values: (made, all) => (lowest ? this.ticks(0, made, all) : []) }),
        axis({ size: 48, space: 28, label: () => this.title(which + 1), values: (made, all) => this.ticks(which + 1, made, all) }),
      ],
      series: [{}, { stroke: "transparent", points: { show: false } }],
      cursor: { show: false },
      hooks: { draw: [(made) => this.paint(made, which)] },
    });
  }

  extent = [[0, 1], [0, 1], [0, 1]];

  ticks(which, made, all) {
    return this.empty?.[which] === false ? ticks(made, all) : [];
  }

  title(which) {
    return this.axes?.[which] ? title(this.axes[which]) : "";
  }

  fit(made, which) {
    const all = [...this.points.values(), ...this.earlier].filter((point) => point.accepted || point[this.axes[1].key] != null);
    this.empty = [];
    this.extent = this.axes.map(({ key }, index) => {
      const values = all.flatMap((point) => {
        const [value, error] = [point[key], point.errors[key] ?? 0];
        return value == null ? [] : [value - error, value + error];
      });
      if (this.present?.[index] != null && values.length) values.push(this.present[index]);
      this.empty[index] = !values.length;
      return around(values.reduce((low, one) => Math.min(low, one), Infinity), values.reduce((high, one) => Math.max(high, one), -Infinity));
    });
    made.setData([this.extent[0], this.extent[which + 1]]);
  }

  paint(made, which) {
    if (!this.axes.length) return;
    const [x, y] = [this.axes[0].key, this.axes[which + 1].key];
    const { ctx } = made;
    const unit = devicePixelRatio;
    ctx.save();
    ctx.lineWidth = 1.5 * unit;
    const spot = (point) => [made.valToPos(point[x], "x", true), made.valToPos(point[y], "y", true)];
    for (const point of this.earlier) {
      if (point[x] == null || point[y] == null) continue;
      ctx.strokeStyle = ink.earlier;
      diamond(ctx, ...spot(point), 4 * unit);
    }
    const last = [...this.points.values()].at(-1);
    for (const point of this.points.values()) {
      if (point[x] == null || point[y] == null) continue;
      ctx.strokeStyle = ctx.fillStyle = point.accepted ? ink.accent : ink.bad;
      this.bar(made, point, x, y);
      symbol(ctx, point, ...spot(point), 4 * unit);
      if (point === last) ring(ctx, ...spot(point), 8 * unit);
    }
    const [now, there] = [this.present?.[0], this.present?.[which + 1]];
    if (now != null && there != null) cross(ctx, made.valToPos(now, "x", true), made.valToPos(there, "y", true), 7 * unit);
    ctx.restore();
  }

  bar(made, point, x, y) {
    const { ctx } = made;
    const cap = 3 * devicePixelRatio;
    const at = [made.valToPos(point[x], "x", true), made.valToPos(point[y], "y", true)];
    for (const [scale, key] of [["x", x], ["y", y]]) {
      const error = point.errors[key];
      if (!error) continue;
      const [from, to] = [-error, error].map((part) => made.valToPos(point[key] + part, scale, true));
      ctx.beginPath();
      const lines = scale === "x" ? [[from, at[1], to, at[1]], [from, at[1] - cap, from, at[1] + cap], [to, at[1] - cap, to, at[1] + cap]] : [[at[0], from, at[0], to], [at[0] - cap, from, at[0] + cap, from], [at[0] - cap, to, at[0] + cap, to]];
      for (const [x0, y0, x1, y1] of lines) {
        ctx.moveTo(x0, y0);
        ctx.lineTo(x1, y1);
      }
      ctx.stroke();
    }
  }

  recolour() {
    for (const made of this.plots) made.redraw(false, true);
  }
}

const title = ({ heading, unit }) => (unit ? `${heading} / ${readable(unit)}` : heading);

const mark = (point) => (!point.accepted ? "✕" : point.quality === "good" ? "●" : "○");

function headings(texts) {
  const row = document.createElement("tr");
  row.append(...texts.map((text) => Object.assign(cell("th", text), { scope: "col" })));
  return row;
}

function cell(tag, text) {
  const made = document.createElement(tag);
  made.textContent = text;
  return made;
}

function symbol(ctx, point, x, y, size) {
  ctx.beginPath();
  if (!point.accepted) {
    ctx.moveTo(x - size, y - size);
    ctx.lineTo(x + size, y + size);
    ctx.moveTo(x - size, y + size);
    ctx.lineTo(x + size, y - size);
    return ctx.stroke();
  }
  ctx.arc(x, y, size, 0, 2 * Math.PI);
  if (point.quality === "good") return ctx.fill();
  ctx.fillStyle = ink.panel;
  ctx.fill();
  ctx.stroke();
}

function ring(ctx, x, y, size) {
  ctx.strokeStyle = faint(ink.text, 0.7);
  ctx.beginPath();
  ctx.arc(x, y, size, 0, 2 * Math.PI);
  ctx.stroke();
}

function diamond(ctx, x, y, size) {
  ctx.beginPath();
  ctx.moveTo(x, y - size);
  ctx.lineTo(x + size, y);
  ctx.lineTo(x, y + size);
  ctx.lineTo(x - size, y);
  ctx.closePath();
  ctx.stroke();
}

function cross(ctx, x, y, size) {
  ctx.strokeStyle = ink.warn;
  ctx.beginPath();
  ctx.moveTo(x - size, y);
  ctx.lineTo(x + size, y);
  ctx.moveTo(x, y - size);
  ctx.lineTo(x, y + size);
  ctx.stroke();
}
