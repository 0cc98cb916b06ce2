// Two plots over one abscissa: points with their error bars, an earlier run's under them, and where the rig is now.

import * as marks from "./marks.js";
import { ink } from "./palette.js";
import { around, axis, place, plot, ticks, widthOf } from "./plot.js";

const NARROWEST = 48; // pixels of the numbers on the left

export class PointsPlot {
  constructor(parent) {
    this.axes = [];
    this.ranges = [null, null, null];
    [this.points, this.earlier, this.present] = [[], [], null];
    this.widths = [0, 0, 0];
    this.plots = [1, 2].map((which) => this.make(place(parent, "canvas", "Points"), which));
  }

  /** Say what is drawn: key and title of the abscissa and of both ordinates. */
  name(axes) {
    this.axes = axes;
    this.plots.forEach((made, index) =>
      made.root.parentElement.setAttribute("aria-label", `${axes[index + 1].title} over ${axes[0].title}`),
    );
  }

  show(points, earlier, present) {
    [this.points, this.earlier, this.present] = [points, earlier, present];
    this.ranges = this.axes.map((_, index) => this.range(index));
    for (const made of this.plots) made.setData([[0, 1], [0, 1]]);
  }

  /** Range of an axis that holds all points with their bars and, if there are points, the present state; null if none. */
  range(index) {
    const { key } = this.axes[index];
    let [least, most] = [Infinity, -Infinity];
    const hold = (value, error = 0) => {
      if (value == null) return;
      least = Math.min(least, value - error);
      most = Math.max(most, value + error);
    };
    for (const point of [...this.points, ...this.earlier]) hold(point[key], point.errors[key]);
    if (least > most) return null;
    hold(this.present?.[index]);
    return around(least, most);
  }

  make(element, which) {
    const lowest = which === 2;
    const labelled = (index) => (made, all) => (this.ranges[index] ? ticks(made, all) : []);
    const below = lowest
      ? { size: 22, label: () => this.axes[0]?.title ?? "", values: labelled(0) }
      : { size: 8, label: "", labelSize: 0, values: () => [] };
    return plot(element, {
      padding: [8, 12, lowest ? 0 : 4, 0],
      scales: { x: { time: false, range: () => this.ranges[0] ?? [0, 1] }, y: { range: () => this.ranges[which] ?? [0, 1] } },
      axes: [
        axis({ space: 60, ...below }),
        axis({ size: (_, texts) => this.width(which, texts), space: 28, label: () => this.axes[which]?.title ?? "", values: labelled(which) }),
      ],
      series: [{}, { stroke: "transparent", points: { show: false } }],
      cursor: { show: false },
      hooks: { draw: [(made) => this.paint(made, which)] },
    });
  }

  /** Width of the numbers on the left: that of the longer ones of both plots, so that they stand over one another. */
  width(which, texts) {
    this.widths[which] = widthOf(texts, NARROWEST);
    return Math.max(...this.widths);
  }

  paint(made, which) {
    if (!this.axes.length) return;
    const { ctx } = made;
    const pixel = devicePixelRatio;
    const [x, y] = [this.axes[0].key, this.axes[which].key];
    const at = (value, scale) => made.valToPos(value, scale, true);
    const drawn = (points) => points.filter((point) => point[x] != null && point[y] != null);
    ctx.save();
    ctx.lineWidth = 1.5 * pixel;
    ctx.strokeStyle = ink.earlier;
    for (const point of drawn(this.earlier)) marks.diamond(ctx, at(point[x], "x"), at(point[y], "y"), 4.5 * pixel);
    for (const point of drawn(this.points)) {
      ctx.strokeStyle = ctx.fillStyle = point.accepted ? ink.accent : ink.bad;
      const [left, top] = [at(point[x], "x"), at(point[y], "y")];
      const [wide, high] = [point.errors[x] ?? 0, point.errors[y] ?? 0];
      if (wide) marks.level(ctx, at(point[x] - wide, "x"), at(point[x] + wide, "x"), top, 3 * pixel);
      if (high) marks.upright(ctx, left, at(point[y] - high, "y"), at(point[y] + high, "y"), 3 * pixel);
      if (!point.accepted) marks.crossed(ctx, left, top, 4 * pixel);
      else marks.disc(ctx, left, top, 4 * pixel, point.quality === "good" ? null : ink.panel);
    }
    this.paintNow(ctx, drawn(this.points).at(-1), which, at, pixel);
    ctx.restore();
  }

  /** Ring the last point, and mark where the rig is. */
  paintNow(ctx, last, which, at, pixel) {
    const [x, y] = [this.axes[0].key, this.axes[which].key];
    ctx.strokeStyle = ink.muted;
    if (last) marks.ring(ctx, at(last[x], "x"), at(last[y], "y"), 8 * pixel);
    ctx.strokeStyle = ink.warn;
    const [now, there] = [this.present?.[0], this.present?.[which]];
    if (now != null && there != null && this.ranges[which]) marks.plus(ctx, at(now, "x"), at(there, "y"), 7 * pixel);
  }

  recolour() {
    for (const made of this.plots) made.redraw(false, true);
  }
}
