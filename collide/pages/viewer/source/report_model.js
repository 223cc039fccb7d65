/**
 * The data of the page as the rest of it reads them: a report, several states, a check or a comparison behind one face.
 *
 * Nothing is worked out here that Python has not: rows get the class they stand in, and are found by their names.
 */
import { decodeArray } from "./page_data.js";
import { PAIR_CLASSES } from "./verdicts.js";

const EMPTY_DRAWING = { kind: "report", size: 1, shapes: [], bodies: [], states: null };

export class ReportModel {
  /**
   * report, drawing, contacts: the blocks of the page; the last two may be null.
   * ours : of a comparison, the report of collide's own answers.
   */
  constructor(report, drawing, contacts, ours = null) {
    this.drawing = drawing ?? EMPTY_DRAWING;
    this.kind = report.summaries ? "compare" : this.drawing.kind;
    this.bodies = this.drawing.bodies;
    this.states = this.drawing.states;
    this._rowOfName = new Map(this.bodies.map((body, row) => [body.name, row]));
    this._poses = this.states ? decodeArray(this.states.poses, Float32Array) : null;
    this._verdicts = new Map();
    this.ours = ours;
    this.setReport(report);
    this.setContacts(contacts);
  }

  setReport(report) {
    this.report = report;
    this._reports = report.states ? report.states.map((entry) => entry.report) : [this.ours ?? report];
    for (const each of this._reports) markClasses(each, null);
    if (report.trajectory) markClasses(report.trajectory, (row) => this.stateOfShare(row.at.share));
  }

  setContacts(contacts) {
    this._contacts = new Map((contacts ?? []).map((entry) => [pairKey(entry.a, entry.b, entry.state ?? 0), entry]));
  }

  /** A body stands elsewhere, or its verdict is another: of pages that follow a World. */
  changeBody(row, { pose, verdict }) {
    if (pose) this.bodies[row].X_WB = pose;
    if (verdict) this.bodies[row].verdict = verdict;
  }

  get stateCount() {
    return this.states ? this.states.labels.length : Math.max(1, this.report.states?.length ?? 1);
  }

  /** What a state is called. */
  stateLabel(state) {
    return this.states?.labels[state] ?? this.report.states?.[state]?.name ?? "";
  }

  /** The report that holds in a state; along a trajectory there is one, of its start. */
  reportAt(state) {
    return this._reports[this._reports.length > 1 ? state : 0];
  }

  get trajectory() {
    return this.report.trajectory ?? null;
  }

  /** The state drawn nearest to a share of the path. */
  stateOfShare(share) {
    const shares = this.states?.shares;
    if (!shares) return 0;
    let best = 0;
    for (let k = 1; k < shares.length; k += 1) {
      if (Math.abs(shares[k] - share) < Math.abs(shares[best] - share)) best = k;
    }
    return best;
  }

  rowOfBody(name) {
    return this._rowOfName.get(name) ?? null;
  }

  /** Contacts of a pair in a state, null where the page has none; of a trajectory it has those of its start. */
  contactsOf(row, state) {
    return row.at ? null : this._contacts.get(pairKey(row.a, row.b, state)) ?? null;
  }

  /** Every row of pairs that the tables of a state hold, worst class first. */
  pairsAt(state) {
    const rows = [];
    if (this.trajectory) for (const name of PAIR_CLASSES) rows.push(...(this.trajectory[name] ?? []));
    rows.push(...(this.reportAt(state).unanswered ?? []), ...(this.trajectory?.unanswered ?? []));
    for (const name of PAIR_CLASSES) rows.push(...(this.reportAt(state)[name] ?? []));
    return rows;
  }

  /** The row that tells a pair in a state, null where none does. */
  findPair(a, b, state) {
    const rows = [...this.pairsAt(state), ...this.pairsSeen(state), ...(this.report.disagreements ?? [])].filter(
      (row) => (row.a === a && row.b === b) || (row.a === b && row.b === a),
    );
    const here = (row) => (row.in_state ?? (this.trajectory ? 0 : state)) === state;
    return rows.find((row) => here(row) && row.normal) ?? rows.find(here) ?? rows[0] ?? null;
  }

  /** The row with witness points of a pair that another row tells without: of a dispute, of a finding. */
  witnessed(row, state) {
    return row.normal || row.in_state !== undefined ? row : this.findPair(row.a, row.b, state) ?? row;
  }

  /** Rows of a state along a trajectory: numbers alone, witness points are kept of the worst sample. */
  pairsSeen(state) {
    const seen = this.trajectory && this.states ? this.states.rows[state] : null;
    if (!seen) return [];
    return PAIR_CLASSES.flatMap((verdict) =>
      (seen[verdict] ?? []).map(([a, b, distance, lower, upper]) => ({
        a: this.bodies[a].name, b: this.bodies[b].name, distance, lower, upper, verdict, in_state: state,
        depth: distance < 0 ? -distance : null,
      })),
    );
  }

  /** The verdict of every body in a state. */
  verdictsAt(state) {
    if (!this.states?.body_verdicts) return this.bodies.map((body) => body.verdict);
    if (!this._verdicts.has(state)) {
      const verdicts = this.bodies.map((body) => (body.verdict === "never tested" ? body.verdict : "free"));
      for (const [row, verdict] of this.states.body_verdicts[state]) verdicts[row] = verdict;
      this._verdicts.set(state, verdicts);
    }
    return this._verdicts.get(state);
  }

  /** Bodies that move from state to state, with the twelve numbers of each pose: `visit(row, numbers)`. */
  visitPoses(state, visit) {
    if (!this.states) return;
    const moving = this.states.moving;
    moving.forEach((row, k) => {
      const at = (state * moving.length + k) * 12;
      visit(row, this._poses.subarray(at, at + 12));
    });
  }

  /** What decided a pair, as a sentence; "" where the report has none. */
  sentenceOf(how, state) {
    return (this.reportAt(state).proofs ?? []).find((proof) => proof.how === how)?.sentence ?? "";
  }
}

function markClasses(report, stateOf) {
  for (const row of report.unanswered ?? []) row.verdict = "not answered";
  for (const verdict of PAIR_CLASSES) {
    for (const row of report[verdict] ?? []) {
      row.verdict = verdict;
      if (!stateOf) continue;
      row.in_state = stateOf(row);
      row.depth ??= row.distance < 0 ? -row.distance : null;
    }
  }
}

function pairKey(a, b, state) {
  return JSON.stringify([a, b, state]);
}
