// Harmonics of force and response over their fundamentals, and purity.

import { percent } from "./format.js";
import { ink } from "./palette.js";
import { axis, place, plot } from "./plot.js";
import { legend } from "./scope.js";

const LEAST = 0.01; // % of the fundamental: what is less is not drawn
const LOOKS = ["force", "response"];
const WIDTH = 0.36; // of the distance between two orders

export class Harmonics {
  every = 250;

  constructor(parent, hint) {
    this.hint = hint;
    this.harmonics = [];
    this.most = 100;
    this.plot = plot(place(parent, "canvas", "Harmonics of force and response in percent of the fundamental"), {
      scales: { x: { time: false, range: [0.4, 10.6] }, y: { distr: 3, range: () => [LEAST, this.most] } },
      axes: [
        axis({ size: 20, grid: { show: false }, splits: () => [1, 2, 3, 4, 5, 6, 7, 8, 9, 10], values: (_, all) => all.map(String) }),
        axis({ size: 50, space: 18, splits: () => powers(this.most), values: (_, all) => all.map((value) => `${value} %`), filter: (_, all) => all }),
      ],
      series: [{}, { show: true, stroke: "transparent", points: { show: false } }],
      cursor: { show: false },
      hooks: { draw: [(made) => this.bars(made)] },
    });
  }

  reset() {
    this.harmonics = [];
  }

  take({ frame }) {
    this.harmonics = frame?.harmonics ?? [];
  }

  draw() {
    const shares = this.harmonics.map(({ amplitudes }) => (amplitudes ?? []).map((one) => (100 * one) / amplitudes[0]));
    const largest = Math.max(100, ...shares.flat().filter(Number.isFinite));
    this.most = 10 ** Math.ceil(Math.log10(largest) - 1e-9);
    this.shares = shares;
    this.plot.setData([[1, 10], [LEAST, this.most]]);
    legend(this.hint, this.harmonics.map(({ name, purity }) => [name, `pure to ${percent(purity, 1)}`]), 1);
  }

  bars(made) {
    const { ctx } = made;
    const floor = made.valToPos(LEAST, "y", true);
    const wide = made.valToPos(1 + WIDTH, "x", true) - made.valToPos(1, "x", true);
    (this.shares ?? []).forEach((shares, which) => {
      ctx.fillStyle = ctx.strokeStyle = ink[LOOKS[which]];
      ctx.lineWidth = 1.5 * devicePixelRatio;
      shares.forEach((share, index) => {
        if (!(share > LEAST)) return;
        const left = made.valToPos(index + 1 + (which - 1) * WIDTH, "x", true);
        const top = made.valToPos(share, "y", true);
        if (which === 0) ctx.strokeRect(left + 1, top, wide - 3, floor - top); // empty and full, beside their colours
        else ctx.fillRect(left, top, wide - 1, floor - top);
      });
    });
  }

  recolour() {
    this.plot.redraw(false, true);
  }
}

const powers = (most) => {
  const out = [];
  for (let value = LEAST; value <= most * 1.001; value *= 10) out.push(Number(value.toPrecision(1)));
  return out;
};
