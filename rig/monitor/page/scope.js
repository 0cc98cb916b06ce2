// The last periods of output, force and response, each to its own scale, so that their phases can be compared.

import { quantity } from "./format.js";
import { ink } from "./palette.js";
import { axis, place, plot, ticks } from "./plot.js";

const LOOKS = [
  { ink: "output", dash: [2, 3] },
  { ink: "force", dash: [7, 3] },
  { ink: "response", dash: [] },
];
const HELD = 0.97; // how slowly a scale shrinks: a curve that grows is shown at once

export class Scope {
  every = 100;

  constructor(parent, hint) {
    this.hint = hint;
    this.scope = null;
    this.peaks = LOOKS.map(() => 0);
    const scales = { x: { time: false } };
    const series = LOOKS.map((look, index) => {
      scales[`y${index}`] = { range: () => [-1.1 * (this.peaks[index] || 1), 1.1 * (this.peaks[index] || 1)] };
      return { scale: `y${index}`, stroke: () => ink[look.ink], dash: look.dash, width: 1.8, points: { show: false } };
    });
    this.plot = plot(place(parent, "canvas", "Output, force and response over the last periods"), {
      padding: [8, 24, 0, 6],
      scales,
      axes: [axis({ size: 20, space: 70, values: (made, all) => (this.scope?.t_ms?.length ? ticks(made, all).map((text) => `${text} ms`) : []) }), axis({ scale: "y0", size: 12, values: () => [], ticks: { show: false } })],
      series: [{}, ...series],
      cursor: { show: false },
    });
  }

  reset() {
    this.scope = null;
    this.peaks.fill(0);
  }

  take({ frame }) {
    this.scope = frame?.scope ?? null;
  }

  draw() {
    const there = this.scope?.t_ms?.length > 1;
    const curves = there ? this.scope.curves : [];
    curves.forEach((curve, index) => {
      const most = curve.values.reduce((peak, value) => Math.max(peak, Math.abs(value ?? 0)), 0);
      this.peaks[index] = Math.max(most, HELD * this.peaks[index]);
      curve.peak = most;
    });
    this.plot.setData(there ? [this.scope.t_ms, ...curves.map((curve) => curve.values)] : [[0, 1], [], [], []]);
    legend(this.hint, there ? curves.map((curve) => [curve.name, `±${quantity(curve.peak, curve.unit, 3)}`]) : []);
    if (!there) this.hint.textContent = "no whole period yet";
  }

  recolour() {
    this.plot.redraw(false, true);
  }
}

/** Names of curves with a piece of their line: `items` are pairs of name and value, in the order of the looks. */
export function legend(element, items, first = 0) {
  if (element.childElementCount !== items.length)
    element.replaceChildren(
      ...items.map((_, index) => {
        const item = document.createElement("span");
        item.className = `key key-${LOOKS[index + first].ink}`;
        return item;
      }),
    );
  items.forEach(([name, value], index) => {
    const text = `${name} ${value}`;
    if (element.children[index].textContent !== text) element.children[index].textContent = text;
  });
}
