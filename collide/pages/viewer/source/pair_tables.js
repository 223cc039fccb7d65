/**
 * A report as tables, worded as in the terminal (`collide/reports/report_tables.py`); here every list stands in full.
 *
 * A table: `{id, title, hint, columns, rows, of, verdict, notes}`; `of` says what a row is of ("pair", "body" or null).
 * A column: `{title, kind, cell(row), value(row)}`, kind as in the terminal (name, number, label, text); `narrow: false`
 * leaves it out of small windows, where the unfolded row has it.
 */
import { bracketWidth, briefLength, columnFormat, counted, secondsText, volumeText } from "./lengths.js";
import { element, nameNode } from "./text_nodes.js";
import { verdictNode } from "./verdicts.js";

const STAGES = ["read", "meshes", "pack", "broadphase", "narrowphase", "report"];
/** Keys of a report that tables below tell; any other is told as it is, under FURTHER DATA. */
const TOLD = new Set([
  "schema", "verdict", "scene", "query", "pairs", "colliding", "shallow", "touching", "near", "meshes", "approximations",
  "unanswered", "skipped", "proofs", "work", "notes", "seconds", "versions", "trajectory", "geometry", "states", "check",
  "overlaps",
]);

/** Tables of a report's pairs, then of everything that a reader has to know besides. */
export function reportTables(report) {
  const query = report.query ?? { clearance: 0, min_depth: 0, ignored: [] };
  return [
    pairTable("colliding", "COLLIDING", "deepest first", report.colliding ?? [], "depth"),
    pairTable("shallow", "SHALLOW", `proven less deep than ${briefLength(query.min_depth)}, deepest first`,
      report.shallow ?? [], "depth"),
    unansweredTable(report.unanswered ?? []),
    pairTable("near", "NEAR", `apart, nearer than ${briefLength(query.clearance)}, nearest first`,
      report.near ?? [], "distance"),
    pairTable("touching", "TOUCHING", "gap and overlap below rounding", report.touching ?? [], "within"),
    overlapTable(report),
    ...besides(report),
  ].filter((table) => table.rows.length);
}

/** One class of pairs; `measure` says what its number is: depth, distance or within. */
export function pairTable(id, title, hint, rows, measure) {
  const columns = [nameColumn("body A", "a"), nameColumn("body B", "b"), measureColumn(measure, rows)];
  if (measure === "within") {
    columns.push({ title: "exactly", kind: "label", cell: exactVerdict, value: exactVerdict });
  } else {
    columns.push({
      title: "known to", kind: "number", narrow: false,
      cell: (row) => bracketWidth(row.lower, row.upper), value: (row) => (row.upper ?? Infinity) - (row.lower ?? -Infinity),
    });
  }
  columns.push({ title: "decided by", kind: "label", narrow: false, cell: (row) => row.how, value: (row) => row.how });
  return { id, title, hint, columns, rows, of: "pair", verdict: id, notes: bracketNotes(rows, measure) };
}

/** A column of names of bodies; ≈ marks those that stand for another shape. */
export function nameColumn(title, key) {
  const marked = (row) => (row.approximated ?? []).includes(row[key]);
  return {
    title, kind: "name", value: (row) => row[key],
    cell: (row) => element("span", {}, marked(row) ? "≈ " : null, nameNode(row[key], 34)),
  };
}

/** Depths, distances or widths of rows, in one unit. */
export function measureColumn(measure, rows) {
  const text = columnFormat(rows.map((row) => measured(row, measure)));
  return {
    title: measure, kind: "number", value: (row) => measured(row, measure),
    cell: (row) => `${boundSign(row, measure)}${text(measured(row, measure))}`,
  };
}

/** What stands before a number that is only a bound: a depth is at most that, a signed distance at least. */
function boundSign(row, measure) {
  return measure === "within" || !isBound(row) ? "" : measure === "depth" ? "≤ " : "≥ ";
}

function measured(row, measure) {
  if (measure === "within") return Math.max(Math.abs(row.lower ?? Infinity), Math.abs(row.upper ?? Infinity));
  return (measure === "depth" ? row.depth : row.distance) ?? Infinity;
}

/** Whether no depth is known but that it is not larger: of bodies that are not convex. */
export function isBound(row) {
  return row.depth !== null && row.depth !== undefined && row.upper === 0 && row.depth > 0;
}

/** What exact arithmetic says of a pair that rounding cannot tell. */
function exactVerdict(row) {
  if (row.how === "undecided") return "open";
  return row.depth === null ? "apart" : "meet";
}

function bracketNotes(rows, measure) {
  if (measure === "within") return [];
  const notes = rows.some(isBound)
    ? [`${boundSign(rows.find(isBound), measure).trim()}: a move that long along the normal parts the bodies, proven; a shorter one may do`]
    : [];
  const wide = rows.filter((row) => row.certified === false && !isBound(row)).length;
  if (wide) notes.push(`${counted(wide, "pair")} known to less than promised: the unfolded row says to what`);
  return notes;
}

// --- what is told besides -------------------------------------------------------------------------

/** What colliding solids have in common, the largest first. */
function overlapTable(report) {
  return {
    id: "overlaps", title: "OVERLAPS", hint: "volumes that colliding solids have in common", of: "pair", repeats: true,
    rows: [...(report.overlaps ?? [])].sort((a, b) => b.volume - a.volume),
    columns: [
      nameColumn("body A", "a"), nameColumn("body B", "b"),
      { title: "volume", kind: "number", cell: (row) => volumeText(row.volume), value: (row) => row.volume },
    ],
  };
}

function besides(report) {
  const text = (title, key, narrow) => ({ title, kind: "text", cell: (row) => row[key] ?? "", value: (row) => row[key], narrow });
  const pairs = { title: "pairs", kind: "number", cell: (row) => String(row.pairs), value: (row) => row.pairs };
  return [
    {
      id: "approximated", title: "APPROXIMATED", hint: "marked ≈ above: answers hold for what stands in", of: "body",
      columns: [nameColumn("body", "body"), text("stands in", "what"), text("source", "source", false)],
      rows: report.approximations ?? [],
    },
    {
      id: "meshes", title: "MESHES", hint: "as they are, triangle by triangle", of: "body",
      columns: [nameColumn("body", "body"), text("taken as", "what"), text("source", "source", false)],
      // what has no inside is what a reader has to know
      rows: [...(report.meshes ?? [])].sort((a, b) => Number(a.solid) - Number(b.solid)),
    },
    {
      id: "never-tested", title: "NEVER TESTED", hint: neverTestedHint(report), of: null,
      columns: [pairs, text("why", "why")],
      rows: (report.skipped ?? []).map((row) => ({
        pairs: row.pairs, why: row.meaning ? `${row.reason}: ${row.meaning}` : row.reason,
      })),
    },
    {
      id: "proofs", title: "HOW EACH ANSWER IS KNOWN", hint: "", of: null,
      columns: [pairs, text("argument", "how"), text("because", "sentence")], rows: report.proofs ?? [],
    },
    factTable("notes", "NOTES", (report.notes ?? []).map((note, k) => [String(k + 1), note])),
    factTable("asked", "WHAT WAS ASKED", askedFacts(report)),
    factTable("time", "TIME", timeFacts(report)),
    factTable("versions", "VERSIONS AND WORK", versionFacts(report)),
    furtherTable(report),
  ];
}

function neverTestedHint(report) {
  const { excluded, total } = report.pairs ?? {};
  const share = total === undefined ? "" : `${excluded} of ${counted(total, "pair")}; `;
  return `${share}nothing is claimed about these pairs`;
}

function unansweredTable(rows) {
  return {
    id: "unanswered", title: "NOT ANSWERED", hint: "near each other; whether they collide is not known", of: "pair",
    verdict: "colliding", rows,
    columns: [
      nameColumn("body A", "a"), nameColumn("body B", "b"),
      { title: "because", kind: "text", cell: (row) => row.why, value: (row) => row.why },
    ],
  };
}

/** Names of facts with what they are, a line each. */
export function factTable(id, title, facts, hint = "") {
  return {
    id, title, hint, of: null, rows: facts,
    columns: [
      { title: "", kind: "label", cell: ([name]) => name, value: ([name]) => name },
      { title: "", kind: "text", cell: ([, what]) => what, value: ([, what]) => String(what) },
    ],
  };
}

function askedFacts(report) {
  const { scene, query, pairs } = report;
  const facts = [];
  if (scene) {
    facts.push(["scene", scene.name], ["bodies", `${scene.bodies} (${scene.static} fixed)`]);
    if (scene.robots.length) facts.push(["robots", scene.robots.join(", ")]);
    for (const source of scene.sources) facts.push(["read from", source]);
  }
  if (query) {
    facts.push(["clearance", `${briefLength(query.clearance)} (${query.clearance} m)`]);
    facts.push(["least depth", `${briefLength(query.min_depth)} (${query.min_depth} m)`]);
    for (const [a, b] of query.ignored) facts.push(["ignored", element("span", {}, nameNode(a), " and ", nameNode(b))]);
  }
  if (pairs) {
    facts.push(["pairs", `${counted(pairs.total, "pair")}: ${pairs.excluded} never tested, ${pairs.apart_by_boxes} ` +
      `proven apart by their boxes, ${pairs.tested} tested`]);
  }
  return facts;
}

function timeFacts(report) {
  const seconds = report.seconds;
  if (!seconds) return [];
  const others = Object.keys(seconds).filter((name) => ![...STAGES, "other", "total"].includes(name));
  const stages = [...STAGES, ...others].filter((name) => name in seconds).map((name) => [name, secondsText(seconds[name])]);
  const rest = "other" in seconds ? [["imports and the rest", secondsText(seconds.other)]] : [];
  return [["in all", secondsText(seconds.total ?? 0)], ...stages, ...rest];
}

function versionFacts(report) {
  const versions = Object.entries(report.versions ?? {}).map(([name, version]) => [name, version ?? "unknown"]);
  const work = Object.entries(report.work ?? {}).map(([name, n]) => [name.replaceAll("_", " "), String(n)]);
  return [...versions, ...work, ...(report.schema ? [["schema", report.schema]] : [])];
}

/** Keys that no table tells, as they stand in the data: a page hides nothing. */
export function furtherTable(report, told = TOLD) {
  const rows = Object.entries(report).filter(([key]) => !told.has(key));
  return factTable("further", "FURTHER DATA", rows.map(([key, value]) => [key, element("pre", {}, JSON.stringify(value, null, 1))]));
}

/** What is drawn otherwise than it is, and what of the contacts was left out: in words of the data. */
export function drawingTable(drawing) {
  const contacts = typeof drawing.contacts === "string" ? [["contacts", drawing.contacts]]
    : drawing.contacts ? [["contacts", JSON.stringify(drawing.contacts)]] : [];
  return factTable("drawing", "THE PICTURE", [...(drawing.notes ?? []).map((note) => ["note", note]), ...contacts]);
}

/** Every body of the scene with its verdict. */
export function bodyTable(model, state) {
  const verdicts = model.verdictsAt(state);
  const rows = model.bodies.map((body, row) => ({ body: body.name, verdict: verdicts[row], entry: body }));
  const what = (row) => [
    row.entry.kind, row.entry.static ? "fixed" : "", row.entry.owner ? `of ${row.entry.owner}` : "",
  ].filter(Boolean).join(", ");
  return {
    id: "bodies", title: "BODIES", hint: "the worst class that a pair of each is in", of: "body", rows,
    columns: [
      nameColumn("body", "body"),
      { title: "verdict", kind: "label", cell: (row) => verdictNode(row.verdict), value: (row) => row.verdict },
      { title: "what", kind: "text", cell: what, value: what },
    ],
  };
}
