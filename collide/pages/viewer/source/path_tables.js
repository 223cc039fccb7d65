/** Tables of several states and of a trajectory (`collide/reports/state_reports.py`). */
import { briefLength, columnLength, columnFormat, counted } from "./lengths.js";
import { factTable, isBound, measureColumn, nameColumn, pairTable } from "./pair_tables.js";
import { verdictNode } from "./verdicts.js";

/** Where on a trajectory a sample is. */
export function placeText(at, of = "") {
  const time = at.time === null || at.time === undefined ? "" : ` (${Number(at.time.toPrecision(3))} s)`;
  return `${Number((100 * at.share).toPrecision(3))} %${of}${time}`;
}

/** A trajectory in one line. */
export function trajectoryVerdict(trajectory) {
  const { first_collision: first, least, samples } = trajectory;
  if (!trajectory.moving.length) return `the trajectory moves no body: ${counted(samples, "sample")} at one place`;
  if (first) {
    const others = trajectory.colliding.length - 1;
    const more = others > 0 ? `; ${counted(others, "more pair collides", "more pairs collide")} along it` : "";
    return `first collision at ${placeText(first.at, " of the path")}: ${first.a} and ${first.b}${more}`;
  }
  const near = least ? `least clearance ${briefLength(Math.max(0, least.distance))} at ${placeText(least.at, " of it")}: ` +
    `${least.a} and ${least.b}` : "nothing near";
  return `no collision at ${counted(samples, "sample")} of the path; ${near}`;
}

/** The tables of a trajectory: pairs by the worst class that they are ever in. */
export function trajectoryTables(trajectory) {
  const tables = [
    motionTable("colliding", "COLLIDING ALONG THE PATH", "in the order they begin", trajectory, "depth"),
    motionTable("shallow", "SHALLOW ALONG THE PATH", "", trajectory, "depth"),
    motionTable("near", "NEAR ALONG THE PATH", "nearest first", trajectory, "distance"),
    motionTable("touching", "TOUCHING ALONG THE PATH", "gap and overlap below rounding", trajectory, "distance"),
    {
      id: "path-unanswered", title: "NOT ANSWERED ALONG THE PATH", hint: "", of: "pair", rows: trajectory.unanswered ?? [],
      columns: [
        nameColumn("body A", "a"), nameColumn("body B", "b"),
        { title: "because", kind: "text", cell: (row) => row.why, value: (row) => row.why },
      ],
    },
    factTable("path", "THE PATH", pathFacts(trajectory)),
  ];
  return tables.filter((table) => table.rows.length);
}

function motionTable(verdict, title, hint, trajectory, measure) {
  const places = ["at"].map((key) => ({
    title: key, kind: "label", cell: (row) => placeText(row[key]), value: (row) => row[key].share,
  }));
  if (measure === "depth") {
    places.unshift({
      title: "from", kind: "label", narrow: false, cell: (row) => placeText(row.from), value: (row) => row.from.share,
    });
  }
  const columns = [
    nameColumn("body A", "a"), nameColumn("body B", "b"), depthOrDistance(measure, trajectory[verdict] ?? []), ...places,
    { title: "samples", kind: "number", narrow: false, cell: (row) => String(row.samples), value: (row) => row.samples },
  ];
  return { id: `path-${verdict}`, title, hint, columns, rows: trajectory[verdict] ?? [], of: "pair", verdict };
}

function depthOrDistance(measure, rows) {
  const size = (row) => (row.distance === null ? Infinity : Math.abs(row.distance));
  const text = columnFormat(rows.map(size));
  return { ...measureColumn(measure, []), value: size, cell: (row) => `${isBound(row) ? "≤ " : ""}${text(size(row))}` };
}

function pathFacts(trajectory) {
  const { samples, waypoints, resolution, duration, moving, least, source, proof } = trajectory;
  const between = proof ? `; ${proof.text}` : ": by sampling, not certified in between";
  const facts = [
    ["looked at", `${counted(samples, "sample")} through ${counted(waypoints, "waypoint")}, no joint moving more than ` +
      `${resolution} rad or m between two of them${between}`],
    ["read from", source],
  ];
  if (duration !== null && duration !== undefined) facts.push(["takes", `${duration} s`]);
  if (least) facts.push(["least", typeof least === "object" ? leastText(least) : columnLength(least)]);
  if (moving) facts.push(["moves", counted(moving.length, "body", "bodies")]);
  return [...facts, ...(trajectory.notes ?? []).map((note) => ["note", note])];
}

function leastText(least) {
  const pair = least.a === undefined ? "" : `: ${least.a} and ${least.b}`;
  const at = least.at ? ` at ${placeText(least.at)}` : "";
  return `${columnLength(least.distance)}${pair}${at}`;
}

/** The pairs that one state of a trajectory holds, all classes in one table. */
export function seenTable(model, state) {
  const rows = model.pairsSeen(state);
  const leftOut = model.states?.rows[state]?.left_out ?? 0;
  const table = pairTable("seen", "PAIRS IN THIS SAMPLE", model.stateLabel(state), rows, "distance");
  const verdict = { title: "verdict", kind: "label", cell: (row) => verdictNode(row.verdict), value: (row) => row.verdict };
  table.columns = [...table.columns.slice(0, 2), verdict, table.columns[2]];
  if (leftOut) table.notes.push(`${counted(leftOut, "more pair")} of this sample left out of the page`);
  table.verdict = null;
  return table;
}

/** Several states side by side. */
export function stateTable(report) {
  const count = (name) => ({
    title: name, kind: "number", cell: (row) => String(row.report[name].length), value: (row) => row.report[name].length,
  });
  const deepest = (row) => (row.report.colliding.length ? row.report.colliding[0].depth ?? Infinity : 0);
  const text = columnFormat(report.states.map(deepest));
  return {
    id: "states", title: "STATES", hint: report.verdict.text, of: "state", rows: report.states.map((entry, state) => ({ ...entry, state })),
    columns: [
      { title: "state", kind: "label", cell: (row) => row.name, value: (row) => row.name },
      count("colliding"), count("touching"), count("near"),
      { title: "deepest", kind: "number", value: deepest, cell: (row) => (deepest(row) ? text(deepest(row)) : "-") },
    ],
  };
}
