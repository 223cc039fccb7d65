/** What unfolds below a row: every number of a pair with its proven bracket, and how it is known. */
import { bracketWidth, columnLength, counted, directionText, exactLength, pointText, volumeText } from "./lengths.js";
import { isBound } from "./pair_tables.js";
import { placeText } from "./path_tables.js";
import { element, printable, wholeName } from "./text_nodes.js";
import { verdictNode } from "./verdicts.js";

/** The facts of a pair as a list of terms. */
export function pairDetail(row, model, selection) {
  // a dispute or a finding tells less than the report's own row of the pair
  const full = model.witnessed(row, selection.state);
  const facts = [
    ["A", bodyFact(row.a, model, selection)], ["B", bodyFact(row.b, model, selection)],
    ...(full.verdict ? [["verdict", verdictNode(full.verdict)]] : []),
    ...(row.engine ? disputeFacts(row) : row.said ? engineFacts(row) : []),
    ...(full.engine || full.said ? [] : measureFacts(full)),
    ...geometryFacts(full), ...partFacts(full, model),
    ...(full.at ? pathFacts(full) : []),
    ...(full.why ? [["not answered", full.why]] : []),
    ...knownFacts(full, model, selection.state),
    ...contactFacts(model.contactsOf(full, selection.state)),
  ];
  return element("div", { class: "detail" }, factList(facts), element("div", { class: "actions" }, linkButton()));
}

/** Terms and what they are. */
export function factList(facts) {
  const items = facts.flatMap(([term, what]) => [
    element("dt", {}, term), element("dd", {}, typeof what === "string" ? printable(what) : what),
  ]);
  return element("dl", {}, ...items);
}

function bodyFact(name, model, selection) {
  const row = model.rowOfBody(name);
  const note = row === null ? null : model.bodies[row].note;
  const button = element("button", { class: "link", onclick: () => selection.selectBody(name) }, wholeName(name));
  return element("span", {}, button, note ? element("span", { class: "remark" }, ` ≈ ${printable(note)}`) : null);
}

function measureFacts(row) {
  if (row.distance === undefined) return [];
  const facts = [];
  const overlaps = row.depth !== null && row.depth !== undefined;
  const name = overlaps ? "depth" : row.distance === null ? "depth" : "distance";
  const value = overlaps ? row.depth : row.distance;
  facts.push([name, element("span", {}, element("strong", {}, `${isBound(row) ? "≤ " : ""}${columnLength(value)}`),
    element("span", { class: "remark" }, ` ${value === null ? "inside a body without end" : exactLength(value)}`))]);
  facts.push(["signed distance", element("span", {}, `proven in [${exactLength(row.lower)}, ${exactLength(row.upper)}]`,
    element("span", { class: "remark" }, `: known to ${bracketWidth(row.lower, row.upper)}`))]);
  if (isBound(row)) facts.push(["", "a move that long along the normal parts the bodies, proven; a shorter one may do"]);
  return facts;
}

function geometryFacts(row) {
  if (!row.normal) return row.in_state !== undefined && !row.at ? [["witness points", "kept of the worst sample of the path only"]] : [];
  const facts = [
    ["point on A", pointText(row.point_a)], ["point on B", pointText(row.point_b)],
    ["normal A→B", directionText(row.normal)],
  ];
  if (row.depth > 0) {
    const move = row.normal.map((c) => c * row.depth);
    facts.push(["B is free after", `a move of ${pointText(move)} (${columnLength(row.depth)} along the normal)`]);
  }
  return facts;
}

/** Which part of a union, facet of a mesh or point of a cloud decided; nothing where both are the first of few. */
function partFacts(row, model) {
  if (row.part_a === undefined) return [];
  const parts = ["a", "b"].map((side) => {
    const isCloud = model.bodies[model.rowOfBody(row[side])]?.kind === "PointCloud";
    return { isCloud, text: `${isCloud ? "point " : ""}${row[`part_${side}`]} of ${side.toUpperCase()}` };
  });
  return row.part_a || row.part_b || parts.some((part) => part.isCloud) ? [["parts", parts.map((part) => part.text).join(", ")]] : [];
}

function pathFacts(row) {
  const facts = [["worst at", `${placeText(row.at)}, sample ${row.at.sample}, after waypoint ${row.at.waypoint}`]];
  if (row.from) facts.push(["first at", placeText(row.from)]);
  facts.push(["in", counted(row.samples, "sample")]);
  if (row.state) facts.push(["joints", Object.entries(row.state).map(([joint, value]) => `${joint} ${value}`).join(", ")]);
  return facts;
}

function knownFacts(row, model, state) {
  const facts = [];
  if (row.how) {
    const sentence = model.sentenceOf(row.how, state);
    facts.push(["decided by", sentence ? `${row.how}: ${sentence}` : row.how]);
  }
  if (row.certified === true) facts.push(["certified", "the sign is proven and the bracket is as narrow as promised"]);
  if (row.certified === false) facts.push(uncertifiedFact(row));
  for (const name of row.approximated ?? []) {
    facts.push(["≈", element("span", {}, wholeName(name), " stands for another shape: the answer holds for what stands in")]);
  }
  return facts;
}

/** What is known of a row without the promised bracket: an open sign, an overlap between two depths, or a wide gap. */
function uncertifiedFact(row) {
  if (row.how === "undecided") return ["not certified", "the sign is open: touching within rounding"];
  if (typeof row.lower === "number" && row.lower < 0 && row.upper <= 0) {
    return ["colliding", `at most ${columnLength(-row.lower)} deep, at least ${columnLength(-row.upper)} deep, all three proven`];
  }
  return ["not certified", "the sign is proven, the bracket wider than promised"];
}

function contactFacts(contacts) {
  if (!contacts) return [];
  const facts = [];
  const patches = contacts.patches ?? [];
  if (patches.length) {
    const points = patches.reduce((sum, patch) => sum + patch.points.length, 0);
    facts.push(["contacts", `${counted(patches.length, "patch", "patches")} of ${counted(points, "point")}, drawn in the scene`]);
  }
  if (contacts.overlap) {
    const { volume, certified } = contacts.overlap;
    facts.push(["overlap", `${volumeText(volume)}${certified ? ", certified" : ", an estimate"}`]);
  }
  for (const [key, value] of Object.entries(contacts)) {
    if (!["a", "b", "class", "state", "patches", "overlap"].includes(key) && value !== null) facts.push([key.replaceAll("_", " "), plain(value)]);
  }
  return facts;
}

function disputeFacts(row) {
  const told = ["a", "b", "verdict", "state", "in_state", "normal", "point_a", "point_b"];
  return Object.entries(row).filter(([key, value]) => !told.includes(key) && value !== null && value !== "" && value.length !== 0)
    .map(([key, value]) => [key.replaceAll("_", " "), plain(value)]);
}

function engineFacts(row) {
  return [...row.said].map(([engine, dispute]) => [engine, factList(disputeFacts(dispute))]);
}

function plain(value) {
  if (Array.isArray(value) && value.every((entry) => typeof entry !== "object")) return value.join(", ");
  return typeof value === "string" ? value : JSON.stringify(value);
}

function linkButton() {
  const done = element("span", { role: "status" });
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(location.href);
      done.textContent = " copied";
    } catch {
      done.textContent = " the address bar has it";
    }
  };
  return element("span", {}, element("button", { onclick: copy }, "copy link to this view"), done);
}
