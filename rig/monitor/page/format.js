// Numbers, times and words as they are read on the page. Every number is shown with its unit.

const NOTHING = "–";

const minus = (text) => text.replace("-", "\u2212");

/** A value with so many decimals; there is no zero below zero. */
export const fixed = (value, digits) => minus((Number(value.toFixed(digits)) === 0 ? 0 : value).toFixed(digits));

const known = (value) => typeof value === "number" && Number.isFinite(value);

/** A value with so many significant digits, without powers of ten between 1e-4 and 1e6. */
export function number(value, digits = 4) {
  if (!known(value)) return NOTHING;
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e6)) return minus(value.toExponential(digits - 1));
  const before = size >= 1 ? Math.floor(Math.log10(size)) + 1 : 1;
  return fixed(value, Math.max(digits - before, 0));
}

/** A value with its unit; displacements given in m are shown in mm. */
export function quantity(value, unit, digits = 4) {
  if (!known(value)) return NOTHING;
  const [shown, name] = unit === "m" ? [1e3 * value, "mm"] : [value, unit];
  return `${number(shown, digits)}\u202f${readable(name)}`.trim();
}

/** A value as one of Python's format patterns writes it, such as ".4f". */
export function patterned(value, pattern) {
  if (!known(value)) return NOTHING;
  const [, digits, kind] = /\.?(\d*)([a-z%]?)/.exec(pattern);
  if (kind === "f") return fixed(value, Number(digits || 6));
  if (kind === "e") return minus(value.toExponential(Number(digits || 6)));
  if (kind === "g") return minus(String(Number(value.toPrecision(Number(digits || 6)))));
  return minus(String(kind === "d" ? Math.round(value) : value));
}

/** A unit with its powers raised. */
export const readable = (unit) => unit.replace("^2", "²").replace("deg", "°");

/** A duration in s as h:mm:ss or m:ss. */
export function duration(seconds) {
  if (!known(seconds)) return NOTHING;
  const whole = Math.max(Math.round(seconds), 0);
  const [hours, minutes, rest] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const two = (part) => String(part).padStart(2, "0");
  return hours ? `${hours}:${two(minutes)}:${two(rest)} h` : `${minutes}:${two(rest)} min`;
}

/** A share of a whole in percent. */
export const percent = (share, digits = 0) => (known(share) ? `${(100 * share).toFixed(digits)}\u202f%` : NOTHING);
