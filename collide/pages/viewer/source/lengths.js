/** Numbers as people read them; the same rules as the terminal's report (`collide/reports/number_format.py`). */

/** A length inside a sentence: `50 mm`, `1.5 m`, `20 µm`. */
export function briefLength(metres) {
  const size = Math.abs(metres);
  if (size === 0 || (size >= 1e-3 && size < 1)) return `${significant(metres * 1e3, 6)} mm`;
  if (size >= 1 && size < 1e6) return `${significant(metres, 6)} m`;
  if (size >= 1e-7 && size < 1e-3) return `${significant(metres * 1e6, 6)} µm`;
  return `${significant(metres, 3)} m`;
}

/** A length that stands alone: as in a column of its own; null is unbounded. */
export function columnLength(metres) {
  return isLength(metres) ? inUnit(metres, unitOf(Math.abs(metres))) : "unbounded";
}

/** Lengths of a column, all in the unit of the largest: a function of a length. */
export function columnOf(lengths) {
  let largest = 0;
  for (const metres of lengths) if (isLength(metres)) largest = Math.max(largest, Math.abs(metres));
  const unit = unitOf(largest);
  return (metres) => (isLength(metres) ? inUnit(metres, unit) : "unbounded");
}

function isLength(metres) {
  return metres !== null && metres !== undefined && Number.isFinite(metres);
}

/** `[name, units in a metre]`; null where numbers are powers of ten of a metre. */
function unitOf(largest) {
  if (largest >= 1e6 || (largest > 0 && largest < 1e-7)) return ["m", null];
  if (largest >= 10) return ["m", 1];
  return largest >= 1e-4 || largest === 0 ? ["mm", 1e3] : ["µm", 1e6];
}

/** Three decimals, more where these would be less than three significant digits. */
function inUnit(metres, [unit, factor]) {
  if (factor === null) return `${metres ? exponential(metres, 2) : "0.000"} ${unit}`;
  const value = metres * factor;
  const size = Math.abs(value);
  if (size === 0 || size >= 0.0995) return `${value.toFixed(3)} ${unit}`;
  return `${size < 1e-4 ? exponential(value, 2) : value.toFixed(2 - Math.floor(Math.log10(size)))} ${unit}`;
}

/** `1.5 m³`, `12.3 cm³`, `0.4 mm³`. */
export function volumeText(cubicMetres) {
  for (const [unit, size] of [["m³", 1], ["cm³", 1e-6]]) {
    if (cubicMetres >= 0.1 * size) return `${significant(cubicMetres / size, 4)} ${unit}`;
  }
  return `${significant(cubicMetres / 1e-9, 4)} mm³`;
}

/** As Python writes it: two digits of the power of ten, at least. */
function exponential(value, digits) {
  return value.toExponential(digits).replace(/e([+-])(\d)$/, "e$10$2");
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
