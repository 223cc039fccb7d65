/**
 * How verdicts look: a colour of Okabe and Ito that people who do not see red and green tell apart, and a pattern and
 * a sign beside it, so that nothing is said by colour alone.
 *
 * M. Okabe, K. Ito, "Color universal design" (2008).
 */
import { element } from "./text_nodes.js";

/** Worst first. `pattern` is a row of the shader's patterns, `height` the part of the strip over time that it takes. */
export const VERDICTS = {
  colliding: { color: "#d55e00", pattern: 1, sign: "✕", height: 1 },
  shallow: { color: "#e69f00", pattern: 2, sign: "◪", height: 0.82 },
  touching: { color: "#efe352", pattern: 3, sign: "◉", height: 0.64 },
  "not answered": { color: "#5a5a5a", pattern: 6, sign: "?", height: 0.55 },
  near: { color: "#56b4e9", pattern: 4, sign: "↔", height: 0.46 },
  free: { color: "#79c2aa", pattern: 0, sign: "✓", height: 0.28 },
  "never tested": { color: "#e2e2e2", pattern: 5, sign: "–", height: 0.14 },
};
/** Classes that pairs of a report are in. */
export const PAIR_CLASSES = ["colliding", "shallow", "touching", "near"];
/** The two bodies of the selected pair: blue and plain, reddish purple and dotted. */
export const SELECTED = {
  a: { color: "#0072b2", pattern: 0 },
  b: { color: "#cc79a7", pattern: 3 },
};

/** How a verdict looks; one that a later version may bring looks like `free`, under its own word. */
export function lookOf(verdict) {
  return VERDICTS[verdict] ?? VERDICTS.free;
}

/** A little square with colour, pattern and sign. */
export function swatch(verdict) {
  const kind = verdict.replaceAll(" ", "-"); // as classes of the style name it
  return element("span", { class: `swatch ${kind}`, "aria-hidden": "true" }, lookOf(verdict).sign);
}

/** The square and the word. */
export function verdictNode(verdict) {
  return element("span", { class: "verdict" }, swatch(verdict), verdict);
}
