// The points of the run: a table that grows, and what its kind of test yields as a plot.

import { patterned, readable } from "./format.js";
import { PointsPlot } from "./points_plot.js";

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
  damping_ratio: "damping_ratio_std",
  amplitude_m: "amplitude_std_m",
  force_n: "force_std_n",
};
/** What the present state has of it: key of the frame, in the unit that is shown. */
const PRESENT = { amplitude_m: "displacement_mm", frequency_hz: "frequency_hz", force_n: "force_n" };

export class Points {
  every = 250;

  constructor(parent, table, hint) {
    this.hint = hint;
    [this.head, this.body] = [table.tHead, table.tBodies[0]];
    this.scroll = table.parentElement;
    this.plot = new PointsPlot(parent);
    this.clear();
  }

  clear() {
    this.points = new Map();
    this.earlier = [];
    this.rows = new Map();
    this.fresh = [];
  }

  reset({ facts, earlier }) {
    this.clear();
    this.anew = true; // the table is emptied when it is drawn: a "whole" that says nothing new must not flicker
    this.facts = facts;
    if (!facts) return;
    const metres = facts.level_unit === "m";
    const name = { key: "number", heading: "point", unit: "", pattern: "d", scale: 1, counts_from: 1 };
    const level = { key: "level", heading: "level", unit: metres ? "mm" : facts.level_unit, pattern: ".4g", scale: metres ? 1e3 : 1 };
    this.columns = [name, level, ...facts.columns];
    this.shown = this.columns.filter((column) => column.in_line ?? true);
    const told = facts.columns.filter((column) => !column.optional).map((column) => column.key);
    const keys = PLOTS[facts.kind] ?? ["number", ...told.slice(0, 2)];
    this.axes = keys.map((key) => this.columns.find((column) => column.key === key) ?? name);
    this.plot.name(this.axes.map(({ key, ...column }) => ({ key, title: title(column) })));
    this.earlier = (earlier?.lines ?? []).filter((line) => line.is === "point" && line.accepted).map((line) => this.slim(line));
    this.changed = true;
  }

  /** Keep of a point what is shown: a week of them must fit. */
  slim(line) {
    const kept = { number: line.number, quality: line.quality, accepted: line.accepted, errors: {} };
    for (const { key, scale, counts_from: first = 0 } of this.columns) {
      const [value, error] = [line[key], line[ERRORS[key]]];
      kept[key] = typeof value === "number" ? value * scale + first : null;
      if (typeof error === "number") kept.errors[key] = LIMITS_95 * error * scale;
    }
    return kept;
  }

  take({ frame, lines }) {
    this.frame = frame;
    for (const line of lines ?? []) {
      if (line.is !== "point") continue;
      const point = this.slim(line);
      this.points.delete(line.number); // measured again: it takes the place of the earlier one
      this.points.set(line.number, point);
      this.fresh.push([line.number, point]);
      this.changed = true;
      if (this.points.size > KEPT) this.points.delete(this.points.keys().next().value);
    }
    if (this.fresh.length > ROWS) this.fresh.splice(0, this.fresh.length - ROWS);
  }

  draw() {
    if (!this.facts) return;
    if (this.anew || this.fresh.length) this.drawTable();
    const present = this.present();
    if (this.changed || present || this.shownPresent) this.plot.show([...this.points.values()], this.earlier, present);
    this.shownPresent = present;
    this.changed = false;
    const refused = [...this.points.values()].filter((point) => !point.accepted).length;
    const over = this.earlier.length ? " ◇ earlier" : "";
    const bad = refused ? `, ${refused} refused` : "";
    const text = `${this.points.size} of ${this.facts.points}${bad}: ● good ○ warned ✕ refused + now${over}`;
    if (this.hint.textContent !== text) this.hint.textContent = text;
  }

  drawTable() {
    if (this.anew) {
      this.head.replaceChildren(row("th", [...this.shown.map(title), "quality"]));
      this.body.replaceChildren();
    }
    this.anew = false;
    const below = this.scroll.scrollTop + this.scroll.clientHeight >= this.scroll.scrollHeight - 30;
    for (const [number, point] of this.fresh) {
      const mark = !point.accepted ? "✕" : point.quality === "good" ? "●" : "○";
      const texts = this.shown.map((column) => patterned(point[column.key], column.pattern));
      const made = row("td", [...texts, `${mark} ${point.quality}`]);
      made.dataset.quality = point.accepted ? point.quality : "refused";
      this.rows.get(number)?.remove();
      this.rows.delete(number);
      this.rows.set(number, made);
      this.body.append(made);
    }
    for (const [number, made] of this.rows) {
      if (this.rows.size <= ROWS) break;
      made.remove();
      this.rows.delete(number);
    }
    this.fresh = [];
    if (below) this.scroll.scrollTop = this.scroll.scrollHeight;
  }

  /** The present state in the coordinates of the plots, while the rig is driven and where it has them. */
  present() {
    if (!this.frame || this.frame.output_off || !this.frame.frequency_hz) return null;
    const at = this.axes.map(({ key }) => this.frame[PRESENT[key]] ?? null);
    return at[0] === null ? null : at;
  }

  recolour() {
    this.plot.recolour();
  }
}

const title = ({ heading, unit }) => (unit ? `${heading} / ${readable(unit)}` : heading);

function row(kind, texts) {
  const made = document.createElement("tr");
  for (const text of texts) {
    const cell = document.createElement(kind);
    if (kind === "th") cell.scope = "col";
    cell.textContent = text;
    made.append(cell);
  }
  return made;
}
