/**
 * Numbers as people read them: the rules of the terminal's report (`collide/reports/number_format.py`), to the last
 * digit. A test gives thousands of numbers to both.
 */

/** A length inside a sentence: `50 mm`, `1.5 m`, `20 µm`. */
export function briefLength(metres) {
  if (!isNumber(metres)) return "unbounded";
  const size = Math.abs(metres);
  if (size === 0 || (size >= 1e-3 && size < 1)) return `${general(metres * 1e3, 6)} mm`;
  if (size >= 1) return `${general(metres, 6)} m`;
  if (size >= 1e-7) return `${general(metres * 1e6, 6)} µm`;
  return `${general(metres, 3)} m`;
}

/** A volume inside a sentence: `1.5 m³`, `12.3 cm³`, `0.4 mm³`. */
export function volumeText(cubicMetres) {
  for (const [unit, size] of [["m³", 1], ["cm³", 1e-6]]) {
    if (cubicMetres >= 0.1 * size) return `${general(cubicMetres / size, 4)} ${unit}`;
  }
  return `${general(cubicMetres / 1e-9, 4)} mm³`;
}

/** How the lengths of a column are written: a function, all in the unit of the largest; null is unbounded. */
export function columnFormat(values) {
  let largest = null;
  for (const value of values) if (isNumber(value)) largest = Math.max(largest ?? 0, Math.abs(value));
  const [unit, factor] = largest === null ? ["", null] : unitOf(largest);
  return (metres) => (isNumber(metres) ? `${inUnit(metres, factor)} ${unit}` : "unbounded");
}

/** A length that stands alone, as a column of it would have it. */
export function columnLength(metres) {
  return columnFormat([metres])(metres);
}

/** Unit of a column and units in a metre; null where numbers are powers of ten of a metre. */
function unitOf(largest) {
  if (largest >= 1e6 || (largest > 0 && largest < 1e-7)) return ["m", null];
  if (largest >= 10) return ["m", 1];
  return largest >= 1e-4 || largest === 0 ? ["mm", 1e3] : ["µm", 1e6];
}

/** Three decimals, more where these would be less than three significant digits. */
function inUnit(metres, factor) {
  if (factor === null) return metres ? scientific(metres, 2) : "0.000";
  const value = metres * factor;
  const size = Math.abs(value);
  if (size === 0 || size >= 0.0995) return fixed(value, 3);
  return size < 1e-4 ? scientific(value, 2) : fixed(value, 2 - Math.floor(Math.log10(size)));
}

/** How narrow a proven bracket is [m]: one digit says it. */
export function bracketWidth(lower, upper) {
  if (!isNumber(lower) || !isNumber(upper)) return "unbounded";
  return upper === lower ? "exact" : `${scientific(upper - lower, 0)} m`;
}

/** Every digit of a number of metres: reading it back gives the same bits. */
export function exactLength(metres) {
  return isNumber(metres) ? `${metres} m` : "no bound";
}

/** Coordinates of a point [m], to a millionth of the unit that suits them. */
export function pointText(point) {
  const largest = Math.max(...point.map(Math.abs));
  const [unit, metres] = [["m", 1], ["mm", 1e-3], ["µm", 1e-6]].find(
    ([, scale]) => largest >= scale * 0.05 || largest === 0,
  ) ?? ["m", 0];
  if (metres === 0) return `${point.map((c) => scientific(c, 2)).join("  ")} m`;
  return `${point.map((c) => unsignedZero(fixed(c / metres, 6))).join("  ")} ${unit}`;
}

/** A unit vector, four decimals. */
export function directionText(vector) {
  return vector.map((c) => unsignedZero(fixed(c, 4))).join("  ");
}

/** `0.3 ms`, `12 ms`, `1.23 s`. */
export function secondsText(seconds) {
  if (seconds >= 0.9995) return `${fixed(seconds, 2)} s`;
  return seconds < 0.00995 ? `${fixed(seconds * 1e3, 1)} ms` : `${fixed(seconds * 1e3, 0)} ms`;
}

/** `1 pair`, `3 pairs`, `100,000 rows`. */
export function counted(n, singular, plural = `${singular}s`) {
  return `${n.toLocaleString("en-US")} ${n === 1 ? singular : plural}`;
}

/** At most so many significant digits, without zeros at the end: `%g` of C and Python. */
export function general(value, digits) {
  const [mantissa, exponent] = rounded(value, "toExponential", digits - 1).split("e");
  const power = Number(exponent);
  const bare = (text) => (text.includes(".") ? text.replace(/\.?0+$/, "") : text);
  if (power < -4 || power >= digits) return bare(mantissa) + powerText(power);
  return bare(fixed(value, digits - 1 - power));
}

function fixed(value, decimals) {
  const text = rounded(value, "toFixed", decimals);
  return value < 0 && Number(text) === 0 && !text.startsWith("-") ? `-${text}` : text;
}

function scientific(value, decimals) {
  const [mantissa, exponent] = rounded(value, "toExponential", decimals).split("e");
  return mantissa + powerText(Number(exponent));
}

/** Decimals as Python rounds them: of two that are equally near the even one; browsers take either. */
function rounded(value, method, decimals) {
  const tail = value[method](100).split("e")[0].split(".")[1].slice(decimals);
  if (!/^50*$/.test(tail)) return value[method](decimals);
  const sides = [-1, 1].map((side) => (value * (1 + side * Number.EPSILON))[method](decimals));
  return sides.find((text) => /^[^e]*[02468](e|$)/.test(text));
}

function powerText(power) {
  return `e${power < 0 ? "-" : "+"}${String(Math.abs(power)).padStart(2, "0")}`;
}

function unsignedZero(text) {
  return Number(text) === 0 ? text.replace("-", "") : text;
}

function isNumber(value) {
  return typeof value === "number" && Number.isFinite(value);
}
