/**
 * One table on the page: real rows and buttons, a page of rows at a time, sorted by any column, filtered.
 *
 * Lists of 100,000 rows stay usable because no more than a page of them is ever in the document; what is not shown is
 * counted beside the buttons that lead to it.
 */
import { counted } from "./lengths.js";
import { element, printable, refill, shorten } from "./text_nodes.js";

export const ROWS_PER_PAGE = 50;
/** Rows of a table that go to the printer. */
const ROWS_PRINTED = 2000;
/** What rows are of, one and several. */
const WHAT = { pair: ["pair"], body: ["body", "bodies"], state: ["state"], row: ["row"] };

export class TableView {
  /**
   * table : as `pair_tables.js` says.
   * actions : `select(row, table)` of a row that was chosen, `unfold(row, table)` gives what stands below it.
   */
  constructor(table, actions) {
    this.table = table;
    this._actions = actions;
    this._rows = table.rows;
    this._sort = null;
    this._accepts = () => true;
    this._start = 0;
    this._size = ROWS_PER_PAGE;
    this.selected = null;
    this._count = element("span", { class: "count" });
    this._head = element("tr");
    this._body = element("tbody");
    this._pager = element("div", { class: "pager", role: "group", "aria-label": `pages of ${table.title}` });
    this.node = this._build();
    this.render();
  }

  _build() {
    const { id, title, hint, notes } = this.table;
    const hinted = hint ? element("span", { class: "hint" }, printable(hint)) : null;
    const heading = element("summary", {}, element("h2", { id: `title-${id}` }, title), " ", this._count, " ", hinted);
    const head = this.table.columns.some((column) => column.title) ? element("thead", {}, this._head) : null;
    const dense = this.table.columns.length > 6 ? "dense" : null;
    const table = element("table", { class: dense, "aria-labelledby": `title-${id}` }, head, this._body);
    const remarks = (notes ?? []).map((note) => element("p", { class: "remark" }, printable(note)));
    return element("details", { class: `table-section ${id}`, id: `table-${id}`, open: true }, heading,
      element("div", { class: "wide" }, table), this._pager, ...remarks);
  }

  /** Rows that the filters let through, in the order shown. */
  get rows() {
    return this._rows;
  }

  /** Shows the rows that `accepts(row)` lets through. */
  filter(accepts) {
    this._accepts = accepts;
    this._arrange();
  }

  /** Looks as another view of the same table did: open or not, sorted, at the same rows. */
  takeLook(view) {
    this.node.open = view.node.open;
    const column = view._sort && this.table.columns.find((each) => each.title === view._sort.column.title);
    this._sort = column ? { column, sense: view._sort.sense } : null;
    this._arrange();
    this._start = Math.min(view._start, this._size * Math.max(0, Math.ceil(this._rows.length / this._size) - 1));
    this.render();
  }

  _arrange() {
    const rows = this.table.rows.filter(this._accepts);
    if (this._sort) {
      const { column, sense } = this._sort;
      rows.sort((a, b) => sense * compare(column.value(a), column.value(b)));
    }
    this._rows = rows;
    this._start = 0;
    if (this.selected) this._turnTo(this.selected);
    this.render();
  }

  /** Marks and unfolds a row; null marks none. Returns its element where it is shown. */
  select(row) {
    if (row === this.selected) return this._body.querySelector("[aria-current]");
    this.selected = row;
    if (row) this._turnTo(row);
    this.render();
    return this._body.querySelector("[aria-current]");
  }

  _turnTo(row) {
    const at = this._rows.indexOf(row);
    if (at >= 0) this._start = Math.floor(at / this._size) * this._size;
  }

  /** More rows for a printer, or again a page of them. */
  setPrinting(printing) {
    this._size = printing ? ROWS_PRINTED : ROWS_PER_PAGE;
    this._start = 0;
    if (this.selected && !printing) this._turnTo(this.selected);
    this.render();
  }

  render() {
    const total = this.table.rows.length;
    const rows = this._rows.slice(this._start, this._start + this._size);
    const all = counted(total, ...WHAT[this.table.of ?? "row"]);
    this._count.textContent = this._rows.length === total ? all : `${this._rows.length.toLocaleString("en-US")} of ${all}`;
    refill(this._head, ...this.table.columns.map((column) => this._heading(column)));
    refill(this._body, ...rows.flatMap((row) => this._row(row)));
    this._renderPager();
  }

  _heading(column) {
    const sort = this._sort?.column === column ? this._sort.sense : 0;
    const turn = () => {
      this._sort = sort < 0 ? null : { column, sense: sort ? -1 : 1 };
      this._arrange();
      [...this._head.querySelectorAll("button")].find((button) => button.textContent.startsWith(column.title))?.focus();
    };
    const button = column.title && this.table.rows.length > 1
      ? element("button", { class: "sort", title: `sort by ${column.title}`, onclick: turn }, column.title,
        element("span", { "aria-hidden": "true" }, sort > 0 ? " ▲" : sort < 0 ? " ▼" : ""))
      : column.title;
    const order = sort > 0 ? "ascending" : sort < 0 ? "descending" : null;
    return element("th", { scope: "col", class: cellClass(column), "aria-sort": order }, button);
  }

  _row(row) {
    const current = row === this.selected;
    const chooses = this.table.of !== null;
    const cells = this.table.columns.map((column, k) => {
      const content = column.cell(row);
      const inner = typeof content === "string" ? printable(content) : content;
      return element("td", { class: cellClass(column) }, chooses && k === 0 ? this._button(row, inner, current) : inner);
    });
    const select = chooses ? (event) => this._chosen(event, row) : null;
    const shown = element("tr", { class: chooses ? "choice" : null, "aria-current": current ? "true" : null, onclick: select ?? undefined }, ...cells);
    const unfolded = current ? this._actions.unfold(row, this.table) : null;
    if (!unfolded) return [shown];
    return [shown, element("tr", { class: "unfolded" }, element("td", { colspan: cells.length }, unfolded))];
  }

  _button(row, inner, current) {
    const names = row.b === undefined ? null : `${shorten(printable(row.a), 60)} and ${shorten(printable(row.b), 60)}`;
    return element("button", { class: "row-button", "aria-expanded": String(current), "aria-label": names }, inner);
  }

  _chosen(event, row) {
    if (String(window.getSelection?.() ?? "").length && event.detail > 1) return; // the text of a cell is being marked
    this._actions.select(row === this.selected ? null : row, this.table);
    this._body.querySelector("[aria-current] button")?.focus({ preventScroll: true });
  }

  _renderPager() {
    const n = this._rows.length;
    if (n <= this._size) {
      const hidden = this.table.rows.length;
      refill(this._pager, n ? null : element("p", { class: "remark" }, hidden ? `the filters hide ${hidden > 1 ? "all of them" : "it"}` : "none"));
      return;
    }
    const end = Math.min(n, this._start + this._size);
    const leaf = (text, label, start) => element("button", {
      "aria-label": label, disabled: start === null, onclick: () => { this._start = start; this.render(); },
    }, text);
    const last = Math.floor((n - 1) / this._size) * this._size;
    refill(this._pager,
      leaf("⏮", "first rows", this._start ? 0 : null),
      leaf("◀", "rows before", this._start ? this._start - this._size : null),
      element("span", {}, `rows ${(this._start + 1).toLocaleString("en-US")} to ${end.toLocaleString("en-US")} of ${counted(n, "row")}`),
      leaf("▶", "rows after", end < n ? this._start + this._size : null),
      leaf("⏭", "last rows", end < n ? last : null));
  }
}

function cellClass(column) {
  return column.narrow === false ? `${column.kind} spacious` : column.kind;
}

function compare(a, b) {
  if (typeof a === "string" || typeof b === "string") return String(a ?? "").localeCompare(String(b ?? ""));
  return (a ?? Infinity) === (b ?? Infinity) ? 0 : (a ?? Infinity) < (b ?? Infinity) ? -1 : 1;
}
