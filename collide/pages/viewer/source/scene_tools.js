/** Buttons over the scene, the pointer in it, the section plane. */
import { element, nameNode, refill, printable } from "./text_nodes.js";
import { VIEWS } from "./camera_moves.js";
import { briefLength } from "./lengths.js";
import { HoverBox } from "./scene_labels.js";
import { Stage } from "./stage.js";
import { verdictNode } from "./verdicts.js";

const AXES = { x: 0, y: 1, z: 2 };

/** Has the browser save the scene as it is seen. */
function savePicture(canvas, stage, model) {
  stage.render(); // the card may forget a picture as soon as a function ends
  const name = `${(model.reportAt(0).scene?.name ?? "scene").replace(/[^\w.-]+/g, "_").slice(0, 60)}.png`;
  element("a", { download: name, href: canvas.toDataURL("image/png") }).click();
}

export class SceneTools {
  /** nodes : {tools, section, hover, canvas}. */
  constructor(nodes, view, model, selection) {
    this._view = view;
    this._model = model;
    this._selection = selection;
    this._nodes = nodes;
    this._plane = Stage.plane();
    this._buttons = {};
    refill(nodes.tools, ...this._build());
    this._buildSection();
    this._listen(new HoverBox(nodes.hover));
  }

  _build() {
    const plain = (key, text, label, action) => element("button", { title: `${label} (${key})`, "aria-keyshortcuts": key, onclick: action }, text);
    const option = (key, text, label, name, action) => {
      this._buttons[name] = element("button", {
        title: `${label} (${key})`, "aria-keyshortcuts": key, "aria-pressed": "false", onclick: action,
      }, text);
      return this._buttons[name];
    };
    const group = (label, ...buttons) => element("span", { class: "group", role: "group", "aria-label": label }, ...buttons);
    const made = [
      group("camera", plain("f", "fit", "all bodies, or the selected ones", () => this.run("fit")),
        plain("1", "front", "view from the front", () => this.run("front")),
        plain("2", "side", "view from the side", () => this.run("side")),
        plain("3", "top", "view from above", () => this.run("top")),
        plain("4", "iso", "view from a corner", () => this.run("iso")),
        option("o", "parallel", "orthographic view", "orthographic", () => this.run("orthographic"))),
      group("bodies", option("g", "ghosts", "ghost what is not selected", "ghosts", () => this.run("ghosts")),
        option("x", "see-through", "see through the selected bodies", "seeThrough", () => this.run("seeThrough")),
        option("w", "tested", "wire overlay of the geometry really tested", "wire", () => this.run("wire")),
        option("c", "section", "cut bodies open", "section", () => this.run("section")),
        option("r", "frames", "axes of robots' links, or of the selected bodies", "frames", () => this.run("frames"))),
      group("picture", plain("s", "save picture", "the scene as a PNG file", () => this.run("picture"))),
    ];
    this._buttons.ghosts.setAttribute("aria-pressed", "true");
    return made;
  }

  /** Does what a button or a key says. */
  run(name) {
    const view = this._view;
    if (name === "fit") view.fit();
    else if (name === "picture") savePicture(this._nodes.canvas, view.stage, this._model);
    else if (name in VIEWS) view.fit(VIEWS[name]);
    else if (name === "orthographic") this._press(name, (on) => view.stage.setOrthographic(on));
    else if (name === "section") this._press(name, (on) => this._setSection(on));
    else this._press(name, (on) => view.setOption(name, on));
  }

  _press(name, action) {
    const on = this._buttons[name].getAttribute("aria-pressed") !== "true";
    this._buttons[name].setAttribute("aria-pressed", String(on));
    action(on);
  }

  // --- section plane --------------------------------------------------------------------------------

  _buildSection() {
    const change = () => this._moveSection();
    this._axis = element("select", { "aria-label": "axis of the section", onchange: change },
      ...Object.keys(AXES).map((axis) => element("option", { value: axis }, axis)));
    this._place = element("input", { type: "range", min: 0, max: 1000, value: 500, "aria-label": "place of the section", oninput: change });
    this._flip = element("input", { type: "checkbox", onchange: change });
    this._text = element("output");
    this._nodes.section.hidden = true;
    refill(this._nodes.section, element("label", {}, "cut across ", this._axis), this._place, this._text,
      element("label", {}, this._flip, " other side"));
  }

  _setSection(on) {
    this._nodes.section.hidden = !on;
    if (on) this._moveSection();
    else this._view.setSection([]);
  }

  _moveSection() {
    const axis = AXES[this._axis.value];
    const { min, max } = this._view.bounds;
    const [low, high] = [min.getComponent(axis), max.getComponent(axis)];
    const at = low + ((high - low) * Number(this._place.value)) / 1000;
    const sense = this._flip.checked ? 1 : -1;
    this._plane.normal.set(0, 0, 0).setComponent(axis, sense);
    this._plane.constant = -sense * at;
    const world = at - this._view.point([0, 0, 0]).getComponent(axis);
    this._text.textContent = `${this._axis.value} = ${briefLength(Number(world.toPrecision(4)))}`;
    this._view.setSection([this._plane]);
  }

  // --- pointer --------------------------------------------------------------------------------------

  _listen(hover) {
    const { canvas } = this._nodes;
    let pressed = null;
    let pending = false;
    canvas.addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; hover.hide(); });
    canvas.addEventListener("pointerup", (event) => {
      if (pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 5) this._click(event);
      pressed = null;
    });
    canvas.addEventListener("keydown", (event) => this._steer(event));
    canvas.addEventListener("pointerleave", () => hover.hide());
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons || pending) return;
      pending = true;
      requestAnimationFrame(() => {
        pending = false;
        this._hover(hover, event.clientX, event.clientY);
      });
    });
  }

  /** Arrows orbit, with Shift they pan, + and - zoom: where the picture has the focus. */
  _steer(event) {
    const { stage } = this._view;
    const [x, y] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] ?? [0, 0];
    const zoom = { "+": 0.8, "-": 1.25 }[event.key] ?? 1;
    if ((!x && !y && zoom === 1) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    if (event.shiftKey && zoom === 1) stage.pan(x, y);
    else stage.orbit(x, y, zoom);
  }

  _click(event) {
    if (event.button !== 0) return;
    const hit = this._view.bodyAt(event.clientX, event.clientY);
    if (hit) this._selection.selectBody(this._model.bodies[hit.body].name);
    else this._selection.clear();
  }

  _hover(hover, x, y) {
    const hit = this._view.bodyAt(x, y);
    this._nodes.canvas.classList.toggle("over", Boolean(hit));
    if (!hit) {
      hover.hide();
      return;
    }
    const body = this._model.bodies[hit.body];
    const point = hit.row === undefined ? null : `point ${hit.row}`;
    const what = [body.kind, point, body.static ? "fixed" : null, body.owner ? `of ${printable(body.owner)}` : null].filter(Boolean).join(", ");
    hover.show(x, y, nameNode(body.name, 60), verdictNode(this._model.verdictsAt(this._selection.state)[hit.body]),
      element("span", { class: "remark" }, body.note ? `${what}; ≈ ${printable(body.note)}` : what));
  }
}
