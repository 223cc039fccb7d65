/** Labels over the scene, as text of the page: names and numbers that stay sharp and can be read aloud. */
import { Vector3 } from "three";
import { element, refill, svgElement } from "./text_nodes.js";

const AXES = [["x", new Vector3(1, 0, 0), "#d55e00"], ["y", new Vector3(0, 1, 0), "#009e73"], ["z", new Vector3(0, 0, 1), "#0072b2"]];

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

  _place() {
    const taken = [];
    for (const { point, node } of this._labels) {
      const at = this._stage.project(point);
      node.hidden = at === null;
      if (at === null) continue;
      const y = freeHeight(at, taken, node);
      // words stay in the picture; badges stand where they point
      const last = this._node.clientWidth - node.offsetWidth - 10;
      const x = node.classList.contains("badge") ? at.x : Math.max(0, Math.min(at.x, last));
      node.style.transform = `translate(${Math.round(x)}px, ${Math.round(y)}px)`;
    }
  }
}

/** Labels with words move down past each other; badges stay where they point. */
function freeHeight(at, taken, node) {
  if (node.classList.contains("badge")) return at.y;
  let y = at.y;
  while (taken.some((other) => Math.abs(other.y - y) < 22 && Math.abs(other.x - at.x) < 150)) y += 22;
  taken.push({ x: at.x, y });
  return y;
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
