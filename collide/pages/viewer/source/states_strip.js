/** States: a slider, a strip of verdicts over time, the least clearance as a curve, and a button that plays. */
import { columnLength, columnFormat, counted } from "./lengths.js";
import { element, printable, refill, svgElement } from "./text_nodes.js";
import { lookOf, verdictNode } from "./verdicts.js";

const WIDTH = 1000;
const STRIP = 26;
const PLOT = 64;
const SECONDS_UNTIMED = 8;
/** Height of the band of what is proven, between verdicts and curve. */
const BAND = 5;

export class StatesStrip {
  constructor(node, model, selection) {
    this._model = model;
    this._selection = selection;
    this._node = node;
    this._timer = 0;
    node.hidden = model.stateCount < 2;
    if (node.hidden) return;
    this._build();
    selection.follow((now, changed) => { if (changed.has("state")) this._show(now.state); });
    this._show(selection.state);
  }

  _build() {
    const last = this._model.stateCount - 1;
    this._play = element("button", { class: "play", onclick: () => this.toggle() }, "▶ play");
    this._hold = element("button", {
      class: "hold", title: "this state in a picture beside (h)", "aria-keyshortcuts": "h", "aria-pressed": "false", disabled: true,
      onclick: () => this.hold(),
    }, "◫ hold");
    this._slider = element("input", {
      type: "range", min: 0, max: last, step: 1, value: 0, "aria-label": "state",
      oninput: () => { this.stop(); this._selection.selectState(Number(this._slider.value)); },
    });
    this._label = element("output", { class: "state-label" });
    this._cursor = svgElement("line", { class: "cursor", y1: 0, y2: STRIP + PLOT });
    this._chart = this._buildChart();
    refill(this._node, element("h2", { class: "hidden-title" }, "States"),
      element("div", { class: "state-line" }, this._play, this._slider, this._hold, this._label), this._chart, ...this._remarks());
  }

  /** Left edge and right edge of a state on the chart: states stand where their share of the path is. */
  _edges(k) {
    const { shares } = this._model.states ?? {};
    const n = this._model.stateCount;
    if (!shares) return [(WIDTH * k) / n, (WIDTH * (k + 1)) / n];
    const middle = (i, j) => WIDTH * 0.5 * (shares[Math.max(0, i)] + shares[Math.min(n - 1, j)]);
    return [middle(k - 1, k), middle(k, k + 1)];
  }

  _rowsOfStates() {
    if (this._model.states?.rows) return this._model.states.rows;
    return this._model.report.states.map(({ report }) => ({ verdict: worstOf(report), clearance: leastOf(report) }));
  }

  _buildChart() {
    const rows = this._rowsOfStates();
    const chart = svgElement("svg", {
      class: "chart", viewBox: `0 0 ${WIDTH} ${STRIP + PLOT}`, preserveAspectRatio: "none", role: "img",
      "aria-label": describe(rows, (k) => this._model.stateLabel(k)), onclick: (event) => this._clicked(event),
    }, ...this._bars(rows), ...this._proofBand(), ...this._curve(rows), this._cursor);
    return chart;
  }

  /** Runs of states with one verdict: a bar each, whose height tells the verdict, too. */
  _bars(rows) {
    const bars = [];
    for (let k = 0; k < rows.length; ) {
      let end = k;
      while (end + 1 < rows.length && rows[end + 1].verdict === rows[k].verdict) end += 1;
      const [x] = this._edges(k);
      const [, right] = this._edges(end);
      const look = lookOf(rows[k].verdict);
      const names = `${printable(this._model.stateLabel(k))}${end > k ? ` to ${printable(this._model.stateLabel(end))}` : ""}`;
      bars.push(svgElement("rect", {
        x, width: Math.max(1, right - x), y: STRIP * (1 - look.height), height: STRIP * look.height, fill: look.color,
      }, svgElement("title", {}, `${look.sign} ${rows[k].verdict}: ${names}`)));
      k = end + 1;
    }
    return bars;
  }

  /** What of the path is proven free, what stays open, and what is sampled alone. */
  _proofBand() {
    const proof = this._model.trajectory?.proof;
    if (!proof || !this._model.states?.shares) return [];
    const part = (kind, begin, end, fill, text) => svgElement("rect", {
      class: `proof ${kind}`, x: WIDTH * begin, width: Math.max(2, WIDTH * (end - begin)), y: STRIP, height: BAND, fill,
    }, svgElement("title", {}, `${text}: ${percent(begin)} to ${percent(end)} of the path`));
    const pair = (row) => `not proven, ${printable(row.a)} and ${printable(row.b)}`;
    return [
      part("sampled", 0, 1, "#b9b9b9", "sampled alone"),
      ...proof.proven.map(([begin, end]) => part("proven", begin, end, lookOf("free").color, "proven free")),
      ...proof.open.map((row) => part("open", row.begin, row.end, lookOf("touching").color, pair(row))),
    ];
  }

  /** The least clearance of every state; below the line bodies overlap. */
  _curve(rows) {
    const known = rows.map((row) => row.clearance).filter((value) => value !== null && value !== undefined);
    if (known.length < 2) return [];
    const [low, high] = [Math.min(0, ...known), Math.max(0, ...known)];
    const y = (value) => STRIP + 6 + (PLOT - 12) * (1 - (value - low) / (high - low || 1));
    let path = "";
    let pen = "M";
    rows.forEach((row, k) => {
      if (row.clearance === null || row.clearance === undefined) { pen = "M"; return; }
      const [left, right] = this._edges(k);
      path += `${pen}${((left + right) / 2).toFixed(2)} ${y(row.clearance).toFixed(2)}`;
      pen = "L";
    });
    return [
      svgElement("line", { class: "zero", x1: 0, x2: WIDTH, y1: y(0), y2: y(0) }),
      svgElement("path", { class: "curve", d: path, fill: "none" }),
    ];
  }

  _remarks() {
    const { samples } = this._model.states ?? {};
    const remarks = [];
    const curve = curveText(this._rowsOfStates().map((row) => row.clearance));
    if (curve) remarks.push(curve);
    const proof = this._model.trajectory?.proof;
    const between = proof?.text ? `${printable(proof.text)} (the band under the verdicts)` : "nothing is certified between two of them";
    if (samples) remarks.push(`samples shown: ${printable(samples)}; ${between}`);
    else if (this._model.trajectory) remarks.push(`looked at in samples: ${between}`);
    return [element("p", { class: "remark" }, remarks.join("; "))];
  }

  _clicked(event) {
    const bounds = this._chart.getBoundingClientRect();
    const x = ((event.clientX - bounds.left) / bounds.width) * WIDTH;
    let best = 0;
    for (let k = 0; k < this._model.stateCount; k += 1) if (this._edges(k)[0] <= x) best = k;
    this.stop();
    this._selection.selectState(best);
  }

  _show(state) {
    this._slider.value = state;
    const row = this._rowsOfStates()[state];
    const least = row.clearance === null || row.clearance === undefined ? "" : `, least ${columnLength(row.clearance)}`;
    const label = printable(this._model.stateLabel(state));
    refill(this._label, `${label} (${state + 1} of ${this._model.stateCount}) `, verdictNode(row.verdict), least);
    this._slider.setAttribute("aria-valuetext", `${label}: ${row.verdict}${least}`);
    const [left, right] = this._edges(state);
    this._cursor.setAttribute("x1", (left + right) / 2);
    this._cursor.setAttribute("x2", (left + right) / 2);
  }

  step(by) {
    this.stop();
    const state = Math.min(this._model.stateCount - 1, Math.max(0, this._selection.state + by));
    if (state !== this._selection.state) this._selection.selectState(state);
  }

  /** second : `SecondState`, null where there is no picture. */
  setSecond(second) {
    this._second = second;
    if (this._hold && second) this._hold.disabled = false;
  }

  /** The state that is looked at in a second picture, or that picture away. */
  hold() {
    if (!this._second || this._node.hidden) return;
    this._second.toggle();
    this._hold.setAttribute("aria-pressed", String(this._second.state !== null));
  }

  toggle() {
    if (this._timer) this.stop();
    else this._start();
  }

  stop() {
    clearTimeout(this._timer);
    this._timer = 0;
    if (this._play) this._play.textContent = "▶ play";
  }

  _start() {
    this._play.textContent = "❚❚ pause";
    if (this._selection.state === this._model.stateCount - 1) this._selection.selectState(0);
    this._next();
  }

  /** The next state, after the time that it takes in truth, or eight seconds for all where no times are known. */
  _next() {
    const { times } = this._model.states ?? {};
    const k = this._selection.state;
    if (k >= this._model.stateCount - 1) {
      this.stop();
      return;
    }
    const seconds = times ? times[k + 1] - times[k] : SECONDS_UNTIMED / this._model.stateCount;
    this._timer = setTimeout(() => {
      this._selection.selectState(k + 1);
      if (this._timer) this._next();
    }, 1000 * Math.min(2, Math.max(0.016, seconds)));
  }
}

/** The curve in words: of the nearest pair of each state its signed distance [m], null where there is no number. */
function curveText(clearances) {
  const known = clearances.filter((value) => value !== null && value !== undefined);
  if (!known.length) return "";
  const [low, high] = [Math.min(...known), Math.max(...known)];
  const name = low < 0 ? "signed distance of the nearest pair" : "least clearance";
  const text = columnFormat(known);
  const range = low === high ? `${text(low)} in every state` : `from ${text(low)} to ${text(high)}`;
  const gaps = known.length < clearances.length ? `, without a number in ${counted(clearances.length - known.length, "state")}` : "";
  return `${name} ${range}${gaps}${low < 0 && known.length > 1 ? "; below the line bodies overlap" : ""}`;
}

function percent(share) {
  return `${Number((100 * share).toPrecision(4))} %`;
}

function worstOf(report) {
  return ["colliding", "shallow", "touching", "near"].find((name) => report[name].length) ?? "free";
}

function leastOf(report) {
  const rows = [...report.colliding, ...report.shallow, ...report.touching, ...report.near];
  const distances = rows.map((row) => row.distance).filter((value) => value !== null);
  return distances.length ? Math.min(...distances) : null;
}

function describe(rows, label) {
  const colliding = rows.filter((row) => row.verdict === "colliding").length;
  const first = rows.findIndex((row) => row.verdict === "colliding");
  return `verdicts of ${rows.length} states: ${colliding} colliding${first < 0 ? "" : `, first ${printable(label(first))}`}`;
}
