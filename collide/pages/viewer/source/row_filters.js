/** Filters of rows: verdict, name of a body, least depth, clearance. Every one says what it hides. */
import { briefLength, counted } from "./lengths.js";
import { element, refill } from "./text_nodes.js";
import { PAIR_CLASSES, VERDICTS, swatch } from "./verdicts.js";

const STEPS = 100;

export class RowFilters {
  /** changed : called after every change. */
  constructor(node, model, changed) {
    this._model = model;
    this._changed = changed;
    this._hidden = new Set(); // verdicts
    this._name = "";
    this._minDepth = 0;
    this._clearance = model.reportAt(0).query?.clearance ?? 0;
    this._largest = this._clearance;
    this._status = element("p", { class: "remark", role: "status" });
    this._chips = element("div", { class: "chips", role: "group", "aria-label": "verdicts shown" });
    this._clear = element("button", { onclick: () => this.reset(), hidden: true }, "show all rows");
    refill(node, this._chips, this._fields(), element("p", { class: "status-line" }, this._status, " ", this._clear));
    this._renderChips();
  }

  _fields() {
    this._nameField = element("input", {
      type: "search", id: "filter-name", placeholder: "name of a body", "aria-label": "name of a body", autocomplete: "off", spellcheck: "false",
      oninput: () => this._set(() => { this._name = this._nameField.value; }),
    });
    const fields = [element("label", {}, "body ", this._nameField)];
    if (this._model.kind !== "compare") {
      this._depthField = element("input", {
        type: "number", id: "filter-depth", min: 0, step: "any", value: 0,
        oninput: () => this._set(() => { this._minDepth = Math.max(0, Number(this._depthField.value) || 0) / 1000; }),
      });
      fields.push(element("label", {}, "depth ≥ ", this._depthField, " mm"));
    }
    if (this._largest > 0) fields.push(this._clearanceField());
    return element("div", { class: "fields" }, ...fields);
  }

  _clearanceField() {
    const text = element("output", { for: "filter-clearance" }, briefLength(this._largest));
    this._slider = element("input", {
      type: "range", id: "filter-clearance", min: 0, max: STEPS, value: STEPS, "aria-label": "clearance",
      oninput: () => this._set(() => {
        const step = Number(this._slider.value);
        this._clearance = step === STEPS ? this._largest : (this._largest * step) / STEPS;
        text.textContent = briefLength(this._clearance);
        this._slider.setAttribute("aria-valuetext", text.textContent);
      }),
    });
    this._showClearance = () => { text.textContent = briefLength(this._clearance); };
    return element("label", { title: "rows are kept up to the clearance that was asked" }, "clearance ≤ ", this._slider, " ", text);
  }

  _renderChips() {
    const counts = this._counts();
    const chips = Object.keys(VERDICTS).map((verdict) => element("button", {
      class: "chip", "aria-pressed": String(!this._hidden.has(verdict)),
      title: PAIR_CLASSES.includes(verdict) ? `rows of pairs and bodies: ${verdict}` : `bodies: ${verdict}`,
      onclick: () => this._set(() => this._toggle(verdict)),
    }, swatch(verdict), verdict, element("span", { class: "count" }, counts.get(verdict) ?? "no body")));
    const focused = [...this._chips.children].indexOf(document.activeElement);
    refill(this._chips, ...chips);
    if (focused >= 0) this._chips.children[focused].focus();
  }

  _counts() {
    const counts = new Map();
    for (const verdict of this._model.verdictsAt(this._state ?? 0)) counts.set(verdict, (counts.get(verdict) ?? 0) + 1);
    return new Map([...counts].map(([verdict, n]) => [verdict, counted(n, "body", "bodies")]));
  }

  _toggle(verdict) {
    if (!this._hidden.delete(verdict)) this._hidden.add(verdict);
  }

  _set(change) {
    change();
    this._renderChips();
    this._changed();
  }

  focusName() {
    this._nameField.focus();
  }

  /** The counts anew, after the bodies' verdicts changed. */
  refresh() {
    this._renderChips();
  }

  /** The state whose bodies the chips count. */
  setState(state) {
    this._state = state;
    this._renderChips();
  }

  /** Whether anything may be hidden. */
  get active() {
    return Boolean(this._hidden.size || this._name || this._minDepth || this._clearance < this._largest);
  }

  reset() {
    this._set(() => {
      this._hidden.clear();
      this._name = this._nameField.value = "";
      this._minDepth = 0;
      this._clearance = this._largest;
      if (this._depthField) this._depthField.value = 0;
      if (this._slider) { this._slider.value = STEPS; this._showClearance(); }
    });
  }

  /** A test of rows of one table. */
  acceptor(table) {
    const wanted = this._name.toLowerCase();
    const named = (name) => name.toLowerCase().includes(wanted);
    if (table.of === "pair") {
      return (row) => !this._hidden.has(row.verdict) && (!wanted || named(row.a) || named(row.b)) && this._isWithin(row);
    }
    if (table.of === "body") return (row) => !this._hidden.has(row.verdict) && (!wanted || named(row.body));
    return () => true;
  }

  _isWithin(row) {
    if (row.verdict === "colliding" || row.verdict === "shallow") return row.depth === null || this._depthOf(row) >= this._minDepth;
    return row.verdict !== "near" || this._clearance >= this._largest || row.distance <= this._clearance;
  }

  /** Rows of a trajectory have a signed distance only. */
  _depthOf(row) {
    return row.depth ?? (row.distance === null ? Infinity : -row.distance);
  }

  /** Says how many rows are listed and how many the filters hide. */
  describe(listed, total) {
    const hidden = total - listed;
    this._clear.hidden = !this.active;
    this._status.textContent = hidden
      ? `${counted(listed, "row of pairs", "rows of pairs")} listed, ${hidden.toLocaleString("en-US")} hidden by filters`
      : `all ${counted(total, "row of pairs", "rows of pairs")} listed`;
  }
}
