/** All tables of the state that is looked at, the filters applied to them, and the walk from row to row. */
import { checkTables } from "./check_tables.js";
import { comparisonTables } from "./engine_tables.js";
import { factList, pairDetail } from "./pair_detail.js";
import { bodyTable, drawingTable, pairTable, reportTables } from "./pair_tables.js";
import { seenTable, stateTable, trajectoryTables } from "./path_tables.js";
import { TableView } from "./table_view.js";
import { element, refill, wholeName } from "./text_nodes.js";
import { verdictNode } from "./verdicts.js";

export class TablesPanel {
  constructor(nodes, model, selection) {
    this._nodes = nodes; // {tables, card}
    this._model = model;
    this._selection = selection;
    this._filters = null;
    this._views = [];
    this._seen = null;
    this._build(selection.state);
    selection.follow((now, changed) => this._follow(now, changed));
  }

  setFilters(filters) {
    this._filters = filters;
    this.applyFilters();
  }

  _build(state) {
    const model = this._model;
    const ours = (table) => ({ ...table, id: `ours-${table.id}`, title: `${model.report.reference.toUpperCase()}: ${table.title}` });
    const tables = model.kind === "compare" ? [
      ...comparisonTables(model.report), ...(model.ours ? reportTables(model.ours).map(ours) : []),
    ] : [
      ...(model.report.check ? checkTables(model.report.check) : []),
      ...(model.report.states ? [stateTable(model.report)] : []),
      ...(model.trajectory ? trajectoryTables(model.trajectory) : []),
      ...reportTables(model.reportAt(state)).map((table) => (model.trajectory ? atStart(table) : table)),
    ];
    const drawn = drawingTable(model.drawing);
    if (drawn.rows.length) tables.push(drawn);
    if (model.bodies.length) tables.splice(firstBeside(tables), 0, bodyTable(model, state));
    this._views = tables.map((table) => this._view(table));
    this._placeSeen(state);
    refill(this._nodes.tables, ...this._ordered().map((view) => view.node));
    this.applyFilters();
  }

  /** Everything anew from the model: its report is another one. */
  rebuild() {
    const [before, focus] = [new Map(this._ordered().map((view) => [view.table.id, view])), this._focus()];
    this._build(this._selection.state);
    for (const view of this._ordered()) if (before.has(view.table.id)) view.takeLook(before.get(view.table.id));
    const again = focus ? [...this._nodes.tables.querySelectorAll(focus.place)].find((node) => words(node) === focus.words) : null;
    again?.focus({ preventScroll: true });
  }

  /** Where among the tables the focus is: the table, and what the element says. */
  _focus() {
    const node = document.activeElement;
    const table = this._nodes.tables.contains(node) ? node.closest("details") : null;
    return table ? { place: `#${CSS.escape(table.id)} ${node.localName}`, words: words(node) } : null;
  }

  _view(table) {
    return new TableView(table, {
      select: (row) => this._select(row, table),
      unfold: (row) => this._unfold(row, table),
    });
  }

  /** The table of the one sample that is looked at, made anew with each. */
  _placeSeen(state) {
    const model = this._model;
    this._seen = model.trajectory && model.states ? this._view(seenTable(model, state)) : null;
  }

  _ordered() {
    return this._seen ? [this._seen, ...this._views] : this._views;
  }

  _select(row, table) {
    const selection = this._selection;
    if (!row) selection.clear();
    else if (table.of === "state") selection.selectState(row.state);
    else if (table.of === "body") selection.selectBody(row.body);
    else selection.selectPair(row, this._stateOf(row, table));
  }

  _stateOf(row, table) {
    if (row.in_state !== undefined) return row.in_state;
    return table.start ? 0 : this._selection.state;
  }

  _unfold(row, table) {
    if (table.of === "pair") return pairDetail(row, this._model, this._selection);
    return null;
  }

  _follow(now, changed) {
    if (changed.has("state")) {
      const replaced = this._model.report.states ? this._build(now.state) : this._replaceSeen(now.state);
      if (replaced) this.applyFilters();
    }
    let shown = null;
    for (const view of this._ordered()) {
      const row = view.table.of === "pair" ? now.pair : view.table.of === "body" ? bodyRow(view, now.body) : null;
      const node = view.select(row && view.table.rows.includes(row) ? row : null);
      if (view.table.of === "pair") shown ??= node;
    }
    this._renderCard(now);
    if (changed.has("pair") && shown) scrollTo(shown);
    else if (changed.has("body") && now.body !== null) scrollTo(this._nodes.card);
  }

  _replaceSeen(state) {
    const before = this._seen;
    this._placeSeen(state);
    if (before) before.node.replaceWith(this._seen.node);
    const bodies = this._views.findIndex((view) => view.table.id === "bodies");
    if (bodies >= 0) {
      const view = this._view(bodyTable(this._model, state));
      view.node.open = this._views[bodies].node.open;
      this._views[bodies].node.replaceWith(view.node);
      this._views[bodies] = view;
    }
    return true;
  }

  /** The selected body and every row that it is in. */
  _renderCard(now) {
    this._nodes.card.hidden = now.body === null;
    if (now.body === null) {
      refill(this._nodes.card);
      return;
    }
    const row = this._model.rowOfBody(now.body);
    const pairs = this._model.pairsAt(now.state).filter((pair) => pair.a === now.body || pair.b === now.body);
    const table = { ...pairTable("of-body", "ITS PAIRS", "worst first", pairs, "distance"), verdict: null };
    table.columns = table.columns.filter((column) => column.title !== "decided by");
    if (pairs.length) {
      table.columns.splice(2, 0, { title: "verdict", kind: "label", cell: (pair) => verdictNode(pair.verdict), value: (pair) => pair.verdict });
    }
    const listed = pairs.length ? this._view(table).node
      : element("p", { class: "remark" }, "no row of this page is about it: " +
        "its pairs are farther apart than the clearance, or were never tested");
    refill(this._nodes.card, element("h2", {}, wholeName(now.body)),
      row === null ? null : factList(bodyFacts(this._model, row, now.state)), listed,
      element("button", { onclick: () => this._selection.clear() }, "close"));
  }

  applyFilters() {
    if (!this._filters) return;
    let [listed, total] = [0, 0, this._model.kind === "compare" ? "disagreements" : "pairs"];
    for (const view of this._ordered()) {
      view.filter(this._filters.acceptor(view.table));
      if (view.table.of === "pair" && !view.table.repeats) {
        listed += view.rows.length;
        total += view.table.rows.length;
      }
    }
    this._filters.describe(listed, total);
  }

  /** Selects the row of a pair that is `step` rows after the selected one, across tables. */
  walk(step) {
    const rows = this._ordered().filter((view) => view.table.of === "pair")
      .flatMap((view) => view.rows.map((row) => [row, view.table]));
    if (!rows.length) return;
    const at = rows.findIndex(([row]) => row === this._selection.pair);
    const next = at < 0 ? (step > 0 ? 0 : rows.length - 1) : Math.min(rows.length - 1, Math.max(0, at + step));
    this._select(...rows[next]);
  }

  setPrinting(printing) {
    for (const view of this._ordered()) {
      view.setPrinting(printing);
      if (printing) {
        view.wasOpen = view.node.open;
        view.node.open = true;
      } else view.node.open = view.wasOpen;
    }
  }
}

function words(node) {
  return node.getAttribute("aria-label") ?? node.textContent;
}

function bodyFacts(model, row, state) {
  const body = model.bodies[row];
  const shape = model.drawing.shapes[body.shown] ?? {};
  const facts = [["verdict", verdictNode(model.verdictsAt(state)[row])], ["shape", body.kind]];
  if (body.static) facts.push(["fixed", "it never moves"]);
  if (body.owner) facts.push(["robot", body.owner]);
  if (body.note) facts.push(["≈", body.note]);
  if (body.tested !== null && body.tested !== undefined) {
    facts.push(["tested", "another shape than is drawn: the wire overlay shows it"]);
  }
  if (shape.triangle_count !== undefined) facts.push(["drawn as", drawnText(shape)]);
  const [x, y, z] = [3, 7, 11].map((k) => body.X_WB[k]);
  facts.push(["origin", `${x}, ${y}, ${z} m`]);
  return facts;
}

function drawnText(shape) {
  const number = (n) => n.toLocaleString("en-US");
  const counts = [
    shape.triangle_count ? `${number(shape.triangle_count)} triangles` : "",
    shape.points ? `${number(shape.points.count)} points${shape.points.every > 1 ? ` of ${number(shape.points.of)}` : ""}` : "",
  ].filter(Boolean).join(" and ");
  const fewer = shape.simplified_from ? `, simplified for display from ${number(shape.simplified_from)}` : "";
  const off = shape.deviation ? `, off by at most ${shape.deviation.toPrecision(2)} m` : "";
  return counts ? counts + fewer + off : "nothing: it has no triangles";
}

function bodyRow(view, name) {
  return name === null ? null : view.table.rows.find((row) => row.body === name);
}

/** Where the tables of what is told besides begin. */
function firstBeside(tables) {
  const at = tables.findIndex((table) => ["approximated", "meshes", "never-tested", "engines"].includes(table.id));
  return at < 0 ? tables.length : at;
}

function atStart(table) {
  const title = table.of === "pair" ? `${table.title} AT THE START` : table.title;
  return { ...table, title, start: true };
}

/** A row with all that unfolds below it, as far as there is space: the row itself in any case. */
function scrollTo(node) {
  if (node.nextElementSibling?.classList.contains("unfolded")) node.nextElementSibling.scrollIntoView({ block: "nearest" });
  node.scrollIntoView({ block: "nearest" });
}
