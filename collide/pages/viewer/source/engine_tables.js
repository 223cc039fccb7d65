/** Tables of a comparison: what every engine says, disagreements first (`collide/reports/comparing.py`). */
import { briefLength, columnLength, counted, secondsText } from "./lengths.js";
import { factTable, furtherTable, nameColumn } from "./pair_tables.js";

const TITLES = {
  hit: ["DISAGREEMENTS", "does the pair collide?"],
  inside: ["INSIDE", "one body lies inside the other: engines that see surfaces call it free"],
  distance: ["WRONG DISTANCES", "off by more than the tolerance, the worst first"],
  contradiction: ["CONTRADICTIONS", "an engine's boolean against its own distance"],
  "left out": ["LEFT OUT", "a World gave no row where its pair query finds one"],
};
const TOLD = new Set([
  "reference", "bodies", "pairs", "max_distance", "tolerance", "summaries", "disagreements", "ours_wrong", "peers_wrong",
]);
const COUNTS = [
  "version", "asked", "answered", "hits", "undecided", "without_distance", "agreeing", "hit_disagreements", "inside",
  "distance_disagreements", "wrong", "wrong_within_rounding", "wrong_distances", "contradictions", "not_judged",
];

/** The comparison in one line. */
export function comparisonVerdict(report) {
  const wrong = report.ours_wrong;
  const first = wrong ? `${counted(wrong, "answer")} of ${report.reference} proven wrong`
    : `no answer of ${report.reference} proven wrong`;
  const asked = report.summaries.filter((summary) => !summary.skipped).map((summary) => summary.engine);
  const disputes = report.disagreements.length;
  const parts = [first, `${counted(report.pairs, "pair")} asked of ${asked.join(", ")}`];
  parts.push(disputes ? counted(disputes, "disagreement") : "no disagreement");
  return parts.join("; ");
}

export function comparisonTables(report) {
  const kinds = [...new Set(report.disagreements.map((row) => row.kind))];
  const ordered = [...Object.keys(TITLES).filter((kind) => kinds.includes(kind)),
    ...kinds.filter((kind) => !(kind in TITLES)).sort()];
  return [
    sideBySide(report),
    ...ordered.map((kind) => disputeTable(report, kind)),
    summaryTable(report),
    factTable("asked", "WHAT WAS ASKED", [
      ["bodies", String(report.bodies)], ["pairs", String(report.pairs)], ["reference", report.reference],
      ["distances up to", report.max_distance === null ? "unbounded" : briefLength(report.max_distance)],
      ["tolerance", briefLength(report.tolerance)],
    ].filter(([, what]) => what !== undefined)),
    factTable("skipped-engines", "NOT ASKED", report.summaries.filter((each) => each.skipped).map((each) => [each.engine, each.skipped])),
    furtherTable(report, TOLD),
  ].filter((table) => table.rows.length);
}

/** Each pair of bodies that engines disagree about in one row, a column an engine. */
function sideBySide(report) {
  const rows = new Map();
  for (const dispute of report.disagreements) {
    const key = JSON.stringify([dispute.a, dispute.b]);
    if (!rows.has(key)) rows.set(key, { a: dispute.a, b: dispute.b, said: new Map(), reference: null, exact: null });
    const row = rows.get(key);
    row.said.set(dispute.engine, dispute);
    if (dispute.reference_distance !== null || dispute.reference_hit !== null) row.reference = dispute;
    if (dispute.exact_distance !== null || dispute.exact_hit !== null) row.exact = dispute;
  }
  const engines = report.summaries.filter((each) => !each.skipped && each.engine !== report.reference);
  const column = (title, answer, value) => ({ title, kind: "number", cell: answer, value });
  return {
    id: "engines-side-by-side", title: "ENGINES SIDE BY SIDE", hint: "pairs they disagree about; “agrees”: no dispute",
    of: "pair", repeats: true, rows: [...rows.values()],
    columns: [
      nameColumn("body A", "a"), nameColumn("body B", "b"),
      column(report.reference, (row) => saidText(row.reference?.reference_hit, row.reference?.reference_distance),
        (row) => row.reference?.reference_distance),
      column("exact", (row) => saidText(row.exact?.exact_hit, row.exact?.exact_distance), (row) => row.exact?.exact_distance),
      ...engines.map(({ engine }) => column(engine, (row) => {
        const dispute = row.said.get(engine);
        return dispute ? saidText(dispute.hit, dispute.distance) : "agrees";
      }, (row) => row.said.get(engine)?.distance)),
    ],
  };
}

function disputeTable(report, kind) {
  const rows = report.disagreements.filter((row) => row.kind === kind).sort(
    (a, b) => Number(!a.wrong.length) - Number(!b.wrong.length) || Number(Boolean(a.not_judged)) - Number(Boolean(b.not_judged)) ||
      offBy(b) - offBy(a),
  );
  const [title, hint] = TITLES[kind] ?? [kind.toUpperCase(), ""];
  const number = (name, cell, value) => ({ title: name, kind: "number", cell, value });
  const columns = [
    { title: "engine", kind: "label", cell: (row) => row.engine, value: (row) => row.engine },
    nameColumn("body A", "a"), nameColumn("body B", "b"),
    number("it says", (row) => saidText(row.hit, row.distance), (row) => row.distance),
    number(`${report.reference} says`, (row) => saidText(row.reference_hit, row.reference_distance), (row) => row.reference_distance),
    number("exact", (row) => saidText(row.exact_hit, row.exact_distance), (row) => row.exact_distance),
    { title: "wrong", kind: "text", cell: blame, value: blame },
  ];
  if (kind === "distance") columns.splice(-1, 0, number("off by", (row) => columnLength(offBy(row)), offBy));
  const notes = [...new Set(rows.map((row) => row.not_judged).filter(Boolean))];
  if (rows.some((row) => row.judged_by === "the proven bracket")) {
    notes.push(`by bracket: exact arithmetic cannot tell; it is outside the bracket that ${report.reference} proves`);
  }
  return { id: `dispute-${kind.replaceAll(" ", "-")}`, title, hint, of: "pair", rows, columns, notes, verdict: "colliding" };
}

/** How far an engine's distance is off, or is from the reference's where that is not known. */
function offBy(row) {
  if (row.off !== null && row.off !== undefined) return row.off;
  const truth = row.exact_distance ?? row.reference_distance;
  return truth === null || row.distance === null ? 0 : Math.abs(row.distance - truth);
}

function saidText(hit, distance) {
  if (distance !== null && distance !== undefined) return columnLength(distance);
  return hit === true ? "collides" : hit === false ? "free" : "-";
}

function blame(row) {
  if (row.not_judged) return "not judged";
  const remarks = [row.touching ? "touching" : "", row.judged_by === "the proven bracket" ? "by bracket" : ""].filter(Boolean);
  return `${row.wrong.join(", ") || "none"}${remarks.length ? ` (${remarks.join(", ")})` : ""}`;
}

/** One column an engine: fifteen counts fit below one another, not beside. */
function summaryTable(report) {
  const asked = report.summaries.filter((summary) => !summary.skipped);
  const rows = COUNTS.map((key) => ({ key, of: (summary) => String(summary[key] ?? "-") }));
  const amount = (key) => (summary) => (summary[key]?.pairs ? briefLength(summary[key].difference) : "-");
  rows.push(
    { key: "furthest off", of: amount("furthest_off") }, { key: "widest gap", of: amount("gap") },
    { key: "widest depth", of: amount("depth") },
    { key: "failed", of: (summary) => String(summary.failed?.length ?? 0) },
    { key: "unsupported", of: (summary) => Object.entries(summary.unsupported ?? {}).map(([why, n]) => `${n}: ${why}`).join("; ") || "-" },
    { key: "seconds", of: (summary) => (summary.seconds === null ? "-" : secondsText(summary.seconds)) },
  );
  return {
    id: "engines", title: "ENGINES", hint: "counts of pairs", of: null, rows,
    columns: [
      { title: "", kind: "label", cell: (row) => row.key.replaceAll("_", " "), value: (row) => row.key },
      ...asked.map((summary) => ({
        title: summary.engine, kind: "number", cell: (row) => row.of(summary), value: (row) => row.of(summary),
      })),
    ],
  };
}
