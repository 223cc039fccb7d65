/** What `collide check` found: which pairs count, which of them are new (`collide/reports/checking.py`). */
import { columnLength, columnFormat } from "./lengths.js";
import { nameColumn } from "./pair_tables.js";

/** A table for every state that was checked. */
export function checkTables(checks) {
  return checks.map((check, k) => [check, k, columnFormat(check.findings.map((row) => row.distance))]).map(([check, k, length]) => ({
    id: `check-${k}`, title: check.label ? `CHECK OF ${check.label}` : "CHECK",
    hint: `${check.fails ? "fails" : "passes"}: ${check.verdict}`, of: "pair", repeats: true,
    rows: check.findings,
    columns: [
      { title: "what", kind: "label", cell: (row) => row.what, value: (row) => row.what },
      nameColumn("body A", "a"), nameColumn("body B", "b"),
      { title: "distance", kind: "number", cell: (row) => length(row.distance), value: (row) => row.distance },
      ...optional(check.findings, "before", "depth before", columnLength),
      ...optional(check.findings, "where", "where", String),
    ],
  }));
}

function optional(rows, key, title, text) {
  if (!rows.some((row) => row[key])) return [];
  return [{ title, kind: "label", cell: (row) => (row[key] ? text(row[key]) : ""), value: (row) => row[key] }];
}
