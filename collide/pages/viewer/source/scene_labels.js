/** Labels over the scene, as text of the page: names and numbers that stay sharp and can be read aloud. */
import { Vector3 } from "three";
import { element, refill, svgElement } from "./text_nodes.js";

export const AXES = [["x", new Vector3(1, 0, 0), "#d55e00"], ["y", new Vector3(0, 1, 0), "#009e73"], ["z", new Vector3(0, 0, 1), "#0072b2"]];

export class SceneLabels {
  constructor(node, stage) {
    this._node = node;
    this._stage = stage;
    this._labels = [];
    stage.afterRender(() => this._place());
  }

  /** labels : `{point, kind, content}` with a point of the scene and text or a node. */
  set(labels) {
    this._labels = labels.map(({ point, kind, content }) => ({ point, node: element("span", { class: `tag ${kind}` }, content) }));
    refill(this._node, ...this._labels.map((label) => label.node));
  }

  /** Badges stand where they point; words stand beside, in the picture, off badges and off other words. */
  _place() {
    const placed = this._labels.map(({ point, node }) => ({ at: this._stage.project(point), node, isBadge: node.classList.contains("badge") }));
    for (const { at, node } of placed) node.hidden = at === null;
    const seen = placed.filter(({ at }) => at !== null);
    const taken = [];
    for (const { at, node, isBadge } of [...seen.filter((each) => each.isBadge), ...seen.filter((each) => !each.isBadge)]) {
      node.style.transform = `translate(${Math.round(at.x)}px, ${Math.round(at.y)}px)`;
      const frame = this._node.getBoundingClientRect();
      const own = node.getBoundingClientRect();
      const [dx, dy] = isBadge ? [0, 0] : freeShift(own, frame, taken);
      if (dx || dy) node.style.transform = `translate(${Math.round(at.x + dx)}px, ${Math.round(at.y + dy)}px)`;
      taken.push({ left: own.left + dx, right: own.right + dx, top: own.top + dy, bottom: own.bottom + dy });
    }
  }
}

/** Steps of a label that looks for a free place. */
const STEP = 12;
const MAX_STEPS = 12;

/** The least shift [px] that takes a box into the frame and off the boxes that are taken: down, up, right, left. */
function freeShift(own, frame, taken) {
  const inX = Math.max(frame.left - own.left, Math.min(0, frame.right - 4 - own.right));
  const inY = Math.max(frame.top - own.top, Math.min(0, frame.bottom - 4 - own.bottom));
  const isFree = (dx, dy) => !taken.some((other) =>
    own.left + dx < other.right && own.right + dx > other.left && own.top + dy < other.bottom && own.bottom + dy > other.top);
  const isInside = (dx, dy) => own.left + dx >= frame.left - 1 && own.right + dx <= frame.right + 1
    && own.top + dy >= frame.top - 1 && own.bottom + dy <= frame.bottom + 1;
  for (let k = 0; k <= MAX_STEPS; k += 1) {
    for (const [x, y] of [[0, k], [0, -k], [k, 0], [-k, 0], [k, k], [-k, -k]]) {
      const [dx, dy] = [inX + STEP * x, inY + STEP * y];
      if (isFree(dx, dy) && isInside(dx, dy)) return [dx, dy];
    }
  }
  return [inX, inY];
}

/** Which way the world's axes point, in a corner of the picture; those that point away are paler. */
export function drawAxes(node, stage) {
  const marks = AXES.map(([name, axis, color]) => ({
    axis, line: svgElement("line", { x1: 0, y1: 0, stroke: color }), text: svgElement("text", {}, name),
  }));
  refill(node, ...marks.flatMap(({ line, text }) => [line, text]));
  const seen = new Vector3();
  stage.afterRender(() => {
    for (const { axis, line, text } of marks) {
      seen.copy(axis).transformDirection(stage.camera.matrixWorldInverse);
      line.setAttribute("x2", 20 * seen.x);
      line.setAttribute("y2", -20 * seen.y);
      text.setAttribute("x", 27 * seen.x);
      text.setAttribute("y", -27 * seen.y);
      line.setAttribute("opacity", seen.z < -0.1 ? 0.5 : 1);
    }
  });
}

/** The box that follows the pointer. */
export class HoverBox {
  constructor(node) {
    this._node = node;
  }

  show(x, y, ...content) {
    refill(this._node, ...content);
    this._node.hidden = false;
    const { width, height } = this._node.getBoundingClientRect();
    const bounds = this._node.parentElement.getBoundingClientRect();
    const left = Math.max(4, Math.min(x - bounds.left + 14, bounds.width - width - 4));
    const top = y - bounds.top + 18 + height > bounds.height ? y - bounds.top - height - 10 : y - bounds.top + 18;
    this._node.style.transform = `translate(${Math.round(left)}px, ${Math.round(Math.max(4, top))}px)`;
  }

  hide() {
    this._node.hidden = true;
  }
}
