// Looks: colours as in the printed figure, made lighter on a dark ground until they are seen; numbers as texts.

const dark = matchMedia("(prefers-color-scheme: dark)");
const LEAST_CONTRAST = 4.5; // of curves against the ground
const ink = {};

const luminance = (rgb) =>
  rgb
    .map((part) => part / 255)
    .map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4))
    .reduce((sum, part, index) => sum + part * [0.2126, 0.7152, 0.0722][index], 0);
const rgbOf = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));

const contrast = (one, other) => (Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05);

function shown(hex) {
  let rgb = rgbOf(hex);
  if (dark.matches)
    for (let step = 0; step < 20 && contrast(luminance(rgb), luminance(rgbOf(ink.ground))) < LEAST_CONTRAST; step++)
      rgb = rgb.map((part) => Math.round(part + 0.12 * (255 - part)));
  const alpha = hex.length > 7 ? parseInt(hex.slice(7, 9), 16) / 255 : 1;
  return `rgba(${rgb.join(",")},${alpha.toFixed(3)})`;
}

function readInk() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["ground", "text", "muted", "line"]) ink[name] = style.getPropertyValue(`--${name}`).trim();
}

// Numbers as texts

const minus = (text) => text.replace("-", "\u2212");
const plain = (value, digits = 6) => {
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e7)) return minus(value.toExponential(digits - 2).replace(/\.?0+e/, "e"));
  return minus(String(Number(value.toPrecision(digits))));
};

function tickTexts(values) {
  const steps = values.slice(1).map((value, index) => value - values[index]);
  const digits = Math.max(0, Math.min(9, Math.ceil(-Math.log10(Math.min(...steps.filter((one) => one > 0), 1)) - 1e-9)));
  const longer = steps.some((step) => Math.abs(step - Number(step.toFixed(digits))) > 1e-3 * step) ? 1 : 0;
  return values.map((value) => (value == null ? "" : minus(value.toFixed(digits + longer))));
}

/** Text of a tick of a logarithmic axis; none at an end that is no round number. */
const roundText = (value) => (value == null || Math.abs(Number(value.toPrecision(2)) / value - 1) > 1e-9 ? "" : plain(value));

/** Width of an axis beside the panel, for the longest of its numbers. */
const widthOf = (_, texts) => Math.max(40, 14 + 7.2 * Math.max(0, ...(texts ?? []).map((text) => text.length)));

/** A label "name, unit" in its parts. */
function parts(label) {
  const at = label.lastIndexOf(", ");
  return at < 0 ? [label, ""] : [label.slice(0, at), label.slice(at + 2)];
}

const told = (label, value) => {
  const [name, unit] = parts(label);
  return `${name || "value"}: ${plain(value)}${unit ? `\u202f${unit}` : ""}`;
};
