/** Numbers as people read them; the same rules as the terminal's report (`collide/reports/number_format.py`). */

/** A length inside a sentence: `50 mm`, `1.5 m`, `20 µm`. */
export function briefLength(metres) {
  const size = Math.abs(metres);
  if (size === 0 || (size >= 1e-3 && size < 1)) return `${significant(metres * 1e3, 6)} mm`;
  if (size >= 1 && size < 1e6) return `${significant(metres, 6)} m`;
  if (size >= 1e-7 && size < 1e-3) return `${significant(metres * 1e6, 6)} µm`;
  return `${significant(metres, 3)} m`;
}

/** A length in a column: three decimals and its unit; null is unbounded. */
export function columnLength(metres) {
  if (metres === null || metres === undefined || !Number.isFinite(metres)) return "unbounded";
  const size = Math.abs(metres);
  if (size === 0 || (size >= 1e-4 && size < 10)) return `${(metres * 1e3).toFixed(3)} mm`;
  if (size >= 10 && size < 1e6) return `${metres.toFixed(3)} m`;
  if (size >= 1e-7 && size < 1e-4) return `${(metres * 1e6).toFixed(3)} µm`;
  return `${metres.toExponential(2)} m`;
}

/** How narrow a proven bracket is [m]: one digit says it. */
export function bracketWidth(lower, upper) {
  if (lower === null || upper === null) return "unbounded";
  return upper === lower ? "exact" : `${(upper - lower).toExponential(0)} m`;
}

/** Every digit of a number of metres: reading it back gives the same bits. */
export function exactLength(metres) {
  return metres === null || metres === undefined ? "no bound" : `${metres} m`;
}

/** Coordinates of a point [m], to a millionth of the unit that suits them. */
export function pointText(point) {
  const largest = Math.max(...point.map(Math.abs));
  const [unit, metres] = [["m", 1], ["mm", 1e-3], ["µm", 1e-6]].find(
    ([, scale]) => largest >= scale * 0.05 || largest === 0,
  ) ?? ["m", 0];
  if (metres === 0) return `${point.map((c) => c.toExponential(2)).join("  ")} m`;
  return `${point.map((c) => fixed(c / metres, 6)).join("  ")} ${unit}`;
}

/** A unit vector, four decimals. */
export function directionText(vector) {
  return vector.map((c) => fixed(c, 4)).join("  ");
}

/** `0.3 ms`, `12 ms`, `1.23 s`. */
export function secondsText(seconds) {
  if (seconds >= 0.9995) return `${seconds.toFixed(2)} s`;
  return seconds < 0.00995 ? `${(seconds * 1e3).toFixed(1)} ms` : `${(seconds * 1e3).toFixed(0)} ms`;
}

/** `1 pair`, `3 pairs`, `100,000 rows`. */
export function counted(n, singular, plural = `${singular}s`) {
  return `${n.toLocaleString("en-US")} ${n === 1 ? singular : plural}`;
}

function fixed(value, digits) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text;
}

function significant(value, digits) {
  return String(Number(value.toPrecision(digits)));
}
