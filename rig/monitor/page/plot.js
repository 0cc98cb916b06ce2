// What the plots have in common: axes in the colours of the theme, and a size that follows the page.

import { fixed } from "./format.js";
import { FONT, ink } from "./palette.js";

/** An axis; `more` as uPlot takes it. */
export function axis(more = {}) {
  return {
    stroke: () => ink.muted,
    font: FONT,
    labelFont: FONT,
    labelSize: 16,
    labelGap: 0,
    gap: 4,
    grid: { stroke: () => ink.line, width: 1 },
    ticks: { stroke: () => ink.line, width: 1, size: 4 },
    border: { show: true, stroke: () => ink.line, width: 1 },
    ...more,
  };
}

/** Make a plot in an element; it is as large as the element, at least `least` high. */
export function plot(element, options, least = 60) {
  const size = () => ({ width: Math.max(element.clientWidth, 120), height: Math.max(element.clientHeight, least) });
  const legend = { show: false };
  const made = new uPlot({ ...size(), legend, padding: [8, 10, 0, 0], ...options }, null, element);
  new ResizeObserver(() => made.setSize(size())).observe(element);
  return made;
}

/** Range of an axis around values: some room on both sides, at least `narrowest` wide. */
export function around(least, most, narrowest = 0) {
  if (!(least <= most)) return [0, 1];
  const largest = Math.max(Math.abs(least), Math.abs(most));
  const wide = Math.max(1.12 * (most - least), 2e-4 * largest, narrowest) || 2;
  const middle = (least + most) / 2;
  return [middle - wide / 2, middle + wide / 2];
}

/** Values of ticks without needless digits. */
export const ticks = (_, values) => {
  const step = values.length > 1 ? Math.abs(values[1] - values[0]) : 1;
  let digits = 0;
  while (digits < 6 && Math.abs(step - Number(step.toFixed(digits))) > 1e-6 * step) digits++;
  return values.map((value) => (value == null ? "" : fixed(value, digits)));
};

/** Width of an axis on the left for the longest of its numbers, at least `least`. */
export const widthOf = (texts, least) => Math.max(least, 12 + 6.6 * Math.max(0, ...(texts ?? []).map((text) => text.length)));

/** A plot's place in an element of its own. */
export function place(parent, name, label) {
  const element = document.createElement("div");
  element.className = name;
  element.setAttribute("role", "img");
  element.setAttribute("aria-label", label);
  parent.append(element);
  return element;
}
