/** The scene: bodies at their poses, coloured by verdict, and what the selection and the tools make of them. */
import { AxesHelper, Box3, Color, GridHelper, Vector3 } from "three";
import { BodyBatch, boxAt, poseMatrix, wireColor, wireMaterial } from "./body_batches.js";
import { BodyFrames } from "./body_frames.js";
import { CameraMoves, VIEWS, clearestCorner, cornersOf } from "./camera_moves.js";
import { CloudPoints } from "./cloud_points.js";
import { EdgeLines } from "./edge_lines.js";
import { columnLength } from "./lengths.js";
import { PairMarks } from "./pair_marks.js";
import { isBound } from "./pair_tables.js";
import { SceneLabels, drawAxes } from "./scene_labels.js";
import { ShapeGeometry } from "./shape_geometry.js";
import { paint, solidMaterial } from "./solid_material.js";
import { Stage } from "./stage.js";
import { nameNode } from "./text_nodes.js";
import { SELECTED, lookOf } from "./verdicts.js";

const GHOST = 0.13;
const SEE_THROUGH = 0.42;
const WITHOUT_END = 0.3;
/** Dark in both themes: bodies are brighter than that in either. */
const EDGE = new Color("#101216");
/** Triangles and points up to which edges of the picture are smoothed. */
const MAX_SMOOTHED = 400000;
/** A body so many times as large as the other of a pair is not shown whole. */
const MUCH_LARGER = 6;

export class SceneView {
  /** nodes : {canvas, labels, axes}.   Throws where the browser has no WebGL. */
  constructor(nodes, model, selection) {
    this._model = model;
    this._selection = selection;
    this.options = { ghosts: true, wire: false, seeThrough: false, frames: false };
    this._geometries = model.drawing.shapes.map((shape) => new ShapeGeometry(shape));
    this._placeOrigin();
    const drawn = (geometry) => (geometry ? geometry.triangles.length / 3 + (geometry.points?.count ?? 0) : 0);
    const sum = model.bodies.reduce((total, body) => total + drawn(this._geometries[body.shown]), 0);
    this.stage = new Stage(nodes.canvas, this._size, sum <= MAX_SMOOTHED);
    this.moves = new CameraMoves(this.stage);
    this.marks = new PairMarks(this.stage);
    this.frames = new BodyFrames(this.stage, 0.04 * this._size);
    this._labels = new SceneLabels(nodes.labels, this.stage);
    drawAxes(nodes.axes, this.stage);
    this._solid = solidMaterial();
    this._shown = new BodyBatch(this._geometries, model.bodies.map((body) => body.shown), this._solid.material);
    this._clouds = new CloudPoints(this._geometries, model.bodies, this.stage, this._size);
    this.stage.scene.add(this._shown.mesh, this._clouds.group);
    this._wire = null;
    this._planes = [];
    this._edges = new EdgeLines(this._geometries, model);
    this.stage.scene.add(this._edges.group);
    this._addFloor();
    this.setState(selection.state);
    this.stage.look(this._bounds.getCenter(new Vector3()), VIEWS.iso, 1);
    this._frame();
    selection.follow((now, changed) => this._follow(now, changed));
  }

  get uniforms() {
    return this._solid.uniforms;
  }

  /** Planes that cut bodies open; none where `planes` is empty. */
  setSection(planes) {
    this._solid.material.clippingPlanes = planes;
    if (this._wire) this._wire.mesh.material.clippingPlanes = planes;
    this._edges.setClipping(planes);
    this._clouds.setClipping(planes);
    this._solid.uniforms.cutsOpen.value = planes.length ? 1 : 0;
    this._planes = planes;
    this._mark(this._selection.pair);
  }

  /** The first picture: all bodies but the floor, from a corner. */
  _frame() {
    this.stage.fitCanvas();
    const boxes = this._standing();
    const target = boxes.reduce((around, box) => around.union(box), new Box3()).getCenter(new Vector3());
    const corner = clearestCorner(boxes);
    this.stage.look(target, corner, this.moves.halfHeightOf(boxes, target, corner));
  }

  /** Boxes of all bodies that have an end, without one that lies below all others and reaches beyond them: a floor. */
  _standing() {
    const boxes = this._model.bodies.map((body) => this._boxOf([body.name])).filter((box) => !box.isEmpty());
    if (!boxes.length) return [this._bounds];
    const floor = boxes.reduce((low, box) => (box.max.z < low.max.z ? box : low));
    const others = boxes.filter((box) => box !== floor);
    const rest = others.reduce((around, box) => around.union(box), new Box3());
    const size = floor.getSize(new Vector3());
    const thin = size.z < 0.15 * Math.max(size.x, size.y);
    const below = thin && others.length && floor.max.z <= rest.min.z + 0.01 * this._size;
    const wider = floor.min.x < rest.min.x && floor.max.x > rest.max.x && floor.min.y < rest.min.y && floor.max.y > rest.max.y;
    return below && wider ? others : boxes;
  }

  /** The middle of all that has an end becomes the scene's origin. */
  _placeOrigin() {
    this._origin = [0, 0, 0];
    const around = (unbounded) => {
      const bounds = new Box3();
      for (const body of this._model.bodies) {
        const geometry = this._geometries[body.shown];
        if (geometry && !geometry.isEmpty && geometry.unbounded === unbounded) bounds.union(boxAt(geometry, poseMatrix(body.X_WB, this._origin)));
      }
      return bounds;
    };
    const bounds = around(false).isEmpty() ? around(true) : around(false);
    if (!bounds.isEmpty()) this._origin = bounds.getCenter(new Vector3()).toArray();
    this._bounds = bounds.isEmpty() ? new Box3(new Vector3(-1, -1, -1), new Vector3(1, 1, 1))
      : bounds.translate(new Vector3(...this._origin).negate());
    this._size = this._bounds.getSize(new Vector3()).length();
  }

  /** Where a body's origin is in the world [m]. */
  placeOf(name) {
    const row = this._model.rowOfBody(name);
    return row === null ? null : new Vector3().setFromMatrixPosition(this._matrices[row]).add(new Vector3(...this._origin)).toArray();
  }

  /** Corners of a body's box on the screen [px], of what is before the camera. */
  cornersOf(name) {
    return cornersOf(this._boxOf([name])).map((corner) => this.stage.project(corner)).filter(Boolean).map(({ x, y }) => [x, y]);
  }

  get bounds() {
    return this._bounds;
  }

  /** A point of the world [m] in the scene. */
  point(p_W) {
    return new Vector3(p_W[0] - this._origin[0], p_W[1] - this._origin[1], p_W[2] - this._origin[2]);
  }

  /** A grid at the lowest point, spaced by a power of ten, and the world's axes. */
  _addFloor() {
    const step = 10 ** Math.floor(Math.log10(this._size / 4));
    const n = Math.max(2, 2 * Math.ceil((0.75 * this._size) / step));
    this._grid = new GridHelper(n * step, n, 0x808080, 0x808080);
    this._grid.rotateX(Math.PI / 2);
    this._grid.position.z = this._bounds.min.z - 1e-3 * this._size;
    Object.assign(this._grid.material, { transparent: true, opacity: 0.22, depthWrite: false });
    const axes = new AxesHelper(0.08 * this._size);
    axes.position.copy(this.point([0, 0, 0]));
    axes.visible = axes.position.length() <= 3 * this._size;
    this.stage.scene.add(this._grid, axes);
  }

  /** Some bodies stand elsewhere, verdicts may be others: the camera stays. */
  moveBodies(rows, state) {
    this._edges.addMoving(rows);
    this.setState(state);
    this._mark(this._selection.pair);
  }

  /** Where the camera stands, in the world: the scene's origin is another once bodies come or go. */
  get camera() {
    const { controls, direction, halfHeight, isOrthographic } = this.stage;
    const target_W = controls.target.toArray().map((value, k) => value + this._origin[k]);
    return { target_W, direction: direction.toArray(), halfHeight, isOrthographic };
  }

  takeCamera({ target_W, direction, halfHeight, isOrthographic }) {
    this.stage.setOrthographic(isOrthographic);
    this.stage.look(this.point(target_W), new Vector3(...direction), halfHeight);
  }

  setState(state) {
    this._matrices = this._model.bodies.map((body) => poseMatrix(body.X_WB, this._origin));
    this._model.visitPoses(state, (row, numbers) => { this._matrices[row] = poseMatrix(numbers, this._origin); });
    for (const batch of [this._shown, this._wire, this._clouds]) {
      if (batch) this._matrices.forEach((matrix, row) => batch.setPose(row, matrix));
    }
    this._edges.setPoses(this._matrices);
    this._placeFrames();
    this._repaint();
  }

  /** Axes of what robots carry, or of the selected bodies, where they are asked for. */
  _placeFrames() {
    const chosen = this._emphasised();
    const rows = this._model.bodies.map((_, row) => row).filter((row) => (chosen.length ? chosen.includes(row) : this._model.bodies[row].owner));
    this.frames.set(this.options.frames ? rows.map((row) => this._matrices[row]) : []);
  }

  _follow(now, changed) {
    if (changed.has("state")) this.setState(now.state);
    this._placeFrames();
    this._repaint();
    this._mark(now.pair);
    if (changed.has("pair") && now.pair) this._flyToPair(now.pair);
    if (changed.has("body") && now.body !== null) this._flyToBody(now.body);
  }

  setOption(name, value) {
    this.options[name] = value;
    if (name === "wire" && value && !this._wire) this._addWire();
    if (name === "frames") this._placeFrames();
    this._repaint();
    this._mark(this._selection.pair);
  }

  _addWire() {
    const tested = this._model.bodies.map((body) => body.tested ?? body.shown);
    this._wire = new BodyBatch(this._geometries, tested, wireMaterial());
    this._wire.mesh.material.clippingPlanes = this._planes;
    this._wire.mesh.renderOrder = 2;
    this._matrices.forEach((matrix, row) => this._wire.setPose(row, matrix));
    this.stage.scene.add(this._wire.mesh);
  }

  /** Rows of the bodies that are selected: `[a, b]`, `[body]` or none. */
  _emphasised() {
    const { pair, body } = this._selection;
    return (pair ? [pair.a, pair.b] : body !== null ? [body] : []).map((name) => this._model.rowOfBody(name));
  }

  _repaint() {
    const chosen = this._emphasised();
    const verdicts = this._model.verdictsAt(this._selection.state);
    const ink = new Color(getComputedStyle(this.stage.canvas).getPropertyValue("--wire").trim() || "#222222");
    this._model.bodies.forEach((body, row) => {
      const place = chosen.indexOf(row);
      const pairLook = this._selection.pair && place >= 0 ? (place ? SELECTED.b : SELECTED.a) : null;
      const { color, pattern } = pairLook ?? lookOf(verdicts[row]);
      const opacity = this._opacityOf(row, chosen);
      this._shown.setColor(row, paint(color, pattern, opacity), opacity);
      this._clouds.setLook(row, color, pattern, opacity);
      if (this._wire) {
        this._wire.setColor(row, wireColor(ink), 1);
        this._wire.setVisible(row, !chosen.length || place >= 0 || !this.options.ghosts);
      }
    });
    if (this._wire) this._wire.mesh.visible = this.options.wire;
    this._edges.paint(EDGE, chosen.length && this.options.ghosts ? 0.06 : 0.33);
    this.stage.requestRender();
  }

  _opacityOf(row, chosen) {
    const unbounded = this._geometries[this._model.bodies[row].shown]?.unbounded;
    if (chosen.length && this.options.ghosts && !chosen.includes(row)) return unbounded ? GHOST / 2 : GHOST;
    if (unbounded) return WITHOUT_END;
    return chosen.includes(row) && this.options.seeThrough ? SEE_THROUGH : 1;
  }

  // --- the selected pair ----------------------------------------------------------------------------

  _mark(selected) {
    const pair = selected && this._model.witnessed(selected, this._selection.state);
    this.marks.clear();
    const css = getComputedStyle(this.stage.canvas);
    const ink = css.getPropertyValue("--ink").trim() || "#111111";
    const labels = [];
    const names = pair ? [["a", pair.a], ["b", pair.b]] : [];
    for (const [which, name] of names) {
      const row = this._model.rowOfBody(name);
      if (row === null) continue;
      this._outline(row, ink, which);
      labels.push({ point: this._topOf(row), kind: `body ${which}`, content: tagOf(which, name) });
    }
    const { body } = this._selection;
    if (!pair && body !== null && this._model.rowOfBody(body) !== null) {
      this._outline(this._model.rowOfBody(body), ink, "a");
      labels.push({ point: this._topOf(this._model.rowOfBody(body)), kind: "body", content: nameNode(body, 30) });
    }
    if (pair?.normal) labels.push(...this._witnesses(pair, css));
    if (pair) this._patches(pair, css);
    this._labels.set(labels);
    this.stage.requestRender();
  }

  _topOf(row) {
    const box = boxAt(this._geometries[this._model.bodies[row].shown], this._matrices[row]);
    const top = box.getCenter(new Vector3());
    if (!this._geometries[this._model.bodies[row].shown].unbounded) top.z = box.max.z;
    return top;
  }

  /** Edges of a body: whole lines of A, dashes of B. */
  _outline(row, ink, which) {
    const geometry = this._geometries[this._model.bodies[row].shown];
    if (!geometry?.edges?.length) return;
    const dashed = which === "b" ? 0.015 * boxAt(geometry, this._matrices[row]).getSize(new Vector3()).length() : 0;
    this.marks.addLines(geometry.edges, ink, 1.6, { dashed, matrix: this._matrices[row], onTop: false, planes: this._planes });
  }

  /** Witness points, normal and the move that parts the pair; returns labels. */
  _witnesses(pair, css) {
    const a = this.point(pair.point_a);
    const b = this.point(pair.point_b);
    const normal = new Vector3(...pair.normal);
    const half = this._halfHeightOf(pair);
    const normalColor = css.getPropertyValue("--normal").trim();
    this.marks.addArrow(a, a.clone().addScaledVector(normal, 0.42 * half), normalColor, 1.5);
    const depth = pair.depth ?? (pair.distance < 0 ? -pair.distance : 0);
    const overlaps = depth > 0;
    const labels = [
      { point: a, kind: "badge a", content: "A" }, { point: b, kind: "badge b", content: "B" },
      { point: a.clone().addScaledVector(normal, 0.42 * half), kind: "normal", content: "normal A→B" },
    ];
    if (overlaps) {
      // moving B by its depth along the normal takes its witness point to the one of A
      const end = b.clone().addScaledVector(normal, depth);
      this.marks.addArrow(b, end, css.getPropertyValue("--move").trim(), 5);
      labels.push({ point: b.clone().lerp(end, 0.5), kind: "measure", content: `${isBound(pair) ? "≤ " : ""}${columnLength(depth)}` });
    } else if (pair.distance !== null) {
      this.marks.addLines([...a.toArray(), ...b.toArray()], css.getPropertyValue("--move").trim(), 4, { dashed: 0.12 * Math.max(pair.distance, 1e-9) });
      labels.push({ point: a.clone().lerp(b, 0.5), kind: "measure", content: columnLength(pair.distance) });
    }
    return labels;
  }

  _patches(pair, css) {
    const contacts = this._model.contactsOf(pair, this._selection.state);
    const colors = ["--patch", "--move"].map((name) => css.getPropertyValue(name).trim());
    if (contacts) this.marks.addContacts(contacts, (p) => this.point(p), colors, this._halfHeightOf(pair));
  }

  _radiusOf(name) {
    const row = this._model.rowOfBody(name);
    const geometry = row === null ? null : this._geometries[this._model.bodies[row].shown];
    if (!geometry || geometry.isEmpty || geometry.unbounded) return Infinity;
    return 0.5 * boxAt(geometry, this._matrices[row]).getSize(new Vector3()).length();
  }

  /** How much of the world is looked at: the smaller body, and the gap or depth several times over. */
  _halfHeightOf(pair) {
    const radius = Math.min(this._radiusOf(pair.a), this._radiusOf(pair.b), 0.5 * this._size);
    const size = Math.abs(pair.distance ?? 0);
    return Math.min(Math.max(1.5 * radius, 2 * size), Math.max(16 * size, radius), this._size) || 0.5 * this._size;
  }

  /** Boxes to show of a pair: both bodies; of very unequal ones the smaller, and as much of the other about the point. */
  _framed(pair, middle) {
    const [small, large] = [pair.a, pair.b].sort((a, b) => this._radiusOf(a) - this._radiusOf(b));
    const radius = Math.min(this._radiusOf(small), 0.5 * this._size);
    if (this._radiusOf(large) <= MUCH_LARGER * radius) return [this._boxOf([small]), this._boxOf([large])];
    const about = new Box3(middle.clone(), middle.clone()).expandByScalar(this._halfHeightOf(pair));
    const box = this._boxOf([small]);
    return box.isEmpty() ? [about] : [box, about];
  }

  _flyToPair(selected) {
    const pair = this._model.witnessed(selected, this._selection.state);
    if (pair.normal) {
      const middle = this.point(pair.point_a).lerp(this.point(pair.point_b), 0.5);
      this.moves.flyToPair(middle, new Vector3(...pair.normal), this._framed(pair, middle));
      return;
    }
    this.moves.fit([this._boxOf([pair.a, pair.b])]);
  }

  _flyToBody(name) {
    this.moves.fit([this._boxOf([name])]);
  }

  _boxOf(names) {
    const box = new Box3();
    for (const name of names) {
      const row = this._model.rowOfBody(name);
      const geometry = row === null ? null : this._geometries[this._model.bodies[row].shown];
      if (geometry && !geometry.isEmpty && !geometry.unbounded) box.union(boxAt(geometry, this._matrices[row]));
    }
    return box;
  }

  /** All bodies, or the two selected ones. */
  fit(direction) {
    const names = this._selection.pair ? [this._selection.pair.a, this._selection.pair.b]
      : this._selection.body !== null ? [this._selection.body] : [];
    const box = this._boxOf(names);
    this.moves.fit(box.isEmpty() ? this._standing() : [box.expandByScalar(0.15 * box.getSize(new Vector3()).length())], direction);
  }

  /** The body under a place on the screen (client coordinates), of a cloud the point too; null where there is none. */
  bodyAt(x, y) {
    const ray = this.stage.rayThrough(x, y);
    const hits = [this._shown.pick(ray, this._planes), this._clouds.pick(ray, this._planes, this.stage)].filter(Boolean);
    hits.sort((a, b) => Number(b.opaque) - Number(a.opaque) || a.distance - b.distance);
    return hits[0] ?? null;
  }

  /** Colours that follow light and dark. */
  setTheme() {
    const css = getComputedStyle(this.stage.canvas);
    this.stage.scene.background = new Color(css.getPropertyValue("--scene").trim());
    this._repaint();
    this._mark(this._selection.pair);
  }
}

function tagOf(which, name) {
  const tag = document.createElement("span");
  tag.append(`${which.toUpperCase()} `, nameNode(name, 26));
  return tag;
}

