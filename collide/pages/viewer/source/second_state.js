/** A second picture beside the first: another state of the same bodies, seen by the same camera. */
import { SceneView } from "./scene_view.js";
import { element, printable, refill, svgElement } from "./text_nodes.js";
import { verdictNode } from "./verdicts.js";

export class SecondState {
  /** frame : an element for the picture.   view : of the first picture. */
  constructor(frame, model, selection, view) {
    this._frame = frame;
    this._model = model;
    this._selection = selection;
    this._first = view;
    this._view = null;
    frame.hidden = true;
  }

  /** The state that is held in the second picture, null where there is no such picture. */
  get state() {
    return this._frame.hidden ? null : this._held.state;
  }

  /** Holds the state that is looked at, or takes the second picture away. */
  toggle() {
    this._frame.hidden = !this._frame.hidden;
    if (!this._frame.hidden) this._hold(this._selection.state);
    this._first.stage.requestRender();
  }

  _hold(state) {
    if (!this._view) this._build(state);
    this._held.state = state;
    this._view.setState(state);
    this._view.setTheme();
    this._caption();
    this._followCamera(this._first.stage, this._view.stage);
  }

  /** Colours that follow light and dark. */
  setTheme() {
    this._view?.setTheme();
  }

  _build(state) {
    this._held = new HeldSelection(this._selection, state);
    this._text = element("p", { class: "caption" });
    const nodes = {
      canvas: element("canvas", { role: "img", "aria-label": "another state of the scene" }),
      labels: element("div", { class: "labels", "aria-hidden": "true" }),
      axes: svgElement("svg", { class: "axes", viewBox: "-32 -32 64 64", "aria-hidden": "true" }),
    };
    refill(this._frame, nodes.canvas, nodes.axes, nodes.labels, this._text);
    this._view = new SceneView(nodes, this._model, this._held);
    const [one, two] = [this._first.stage, this._view.stage];
    one.afterRender(() => { if (!this._frame.hidden) this._followCamera(one, two); });
    two.afterRender(() => { if (!this._frame.hidden) this._followCamera(two, one); });
  }

  /** What one picture shows the other shows, too. */
  _followCamera(from, to) {
    if (to.isOrthographic !== from.isOrthographic) to.setOrthographic(from.isOrthographic);
    const apart = to.controls.target.distanceTo(from.controls.target) + to.direction.distanceTo(from.direction) * from.halfHeight
      + Math.abs(to.halfHeight - from.halfHeight);
    if (apart > 1e-6 * from.halfHeight) to.look(from.controls.target, from.direction, from.halfHeight);
  }

  _caption() {
    const { state } = this._held;
    const rows = this._model.states?.rows ?? null;
    const verdict = rows?.[state]?.verdict;
    refill(this._text, `${printable(this._model.stateLabel(state))} `, verdict ? verdictNode(verdict) : null);
  }
}

/** The selection of the page with a state of its own: bodies stay selected in both pictures, pairs in the state they are of. */
class HeldSelection {
  constructor(selection, state) {
    this._selection = selection;
    this.state = state;
  }

  get pair() {
    return this._selection.state === this.state ? this._selection.pair : null;
  }

  get body() {
    return this._selection.body;
  }

  follow(follower) {
    this._selection.follow(() => follower(this, new Set()));
  }
}
