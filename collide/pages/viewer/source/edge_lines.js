/**
 * Edges of all bodies as thin lines, so that boxes read as boxes: one draw call for all that never move, one for each
 * body that does. Left out of scenes with very many edges, where they would hide the bodies.
 */
import { BufferAttribute, BufferGeometry, Group, LineBasicMaterial, LineSegments, Vector3 } from "three";

const MAX_TRIANGLES = 150000;
const MAX_MOVING = 30;

export class EdgeLines {
  constructor(geometries, model) {
    this.group = new Group();
    this._geometries = geometries;
    this._model = model;
    this._material = new LineBasicMaterial({ transparent: true, depthWrite: false });
    this._moving = new Map();
    this._placed = false;
    const shapes = model.bodies.map((body) => geometries[body.shown]).filter((geometry) => geometry && !geometry.unbounded);
    const triangles = [...new Set(shapes)].reduce((sum, geometry) => sum + geometry.triangles.length / 3, 0);
    this._movers = new Set(model.states?.moving ?? []);
    this._fixed = null;
    this._wanted = triangles <= MAX_TRIANGLES && this._movers.size <= MAX_MOVING;
    if (this._wanted) for (const row of this._movers) this._addMoving(row);
  }

  /** These bodies move from now on, too: of a page that follows a World. */
  addMoving(rows) {
    const fresh = rows.filter((row) => !this._movers.has(row));
    if (!this._wanted || !fresh.length) return;
    for (const row of fresh) this._movers.add(row);
    this._wanted = this.group.visible = this._movers.size <= MAX_MOVING;
    if (!this._wanted) return;
    for (const row of fresh) this._addMoving(row);
    if (this._fixed) this.group.remove(this._fixed);
    this._fixed?.geometry.dispose();
    this._placed = false;
  }

  _edgesOf(row) {
    const geometry = this._geometries[this._model.bodies[row].shown];
    return geometry && !geometry.unbounded ? geometry.edges : null;
  }

  _addMoving(row) {
    const edges = this._edgesOf(row);
    if (!edges?.length) return;
    const lines = this._lines(edges);
    lines.matrixAutoUpdate = false;
    this._moving.set(row, lines);
  }

  _lines(points) {
    const lines = new LineSegments(new BufferGeometry().setAttribute("position", new BufferAttribute(points, 3)), this._material);
    lines.frustumCulled = false;
    lines.renderOrder = 1;
    this.group.add(lines);
    return lines;
  }

  /** matrices : the pose of every body. */
  setPoses(matrices) {
    if (!this._wanted) return;
    if (!this._placed) this._placeFixed(matrices);
    for (const [row, lines] of this._moving) {
      lines.matrix.copy(matrices[row]);
      lines.matrixWorldNeedsUpdate = true;
    }
  }

  /** All bodies that never move, in the scene's coordinates. */
  _placeFixed(matrices) {
    this._placed = true;
    const point = new Vector3();
    const parts = matrices.map((matrix, row) => [matrix, this._movers.has(row) ? null : this._edgesOf(row)]).filter(([, edges]) => edges);
    const all = new Float32Array(parts.reduce((sum, [, edges]) => sum + edges.length, 0));
    let at = 0;
    for (const [matrix, edges] of parts) {
      for (let k = 0; k < edges.length; k += 3) {
        point.set(edges[k], edges[k + 1], edges[k + 2]).applyMatrix4(matrix).toArray(all, at);
        at += 3;
      }
    }
    this._fixed = all.length ? this._lines(all) : null;
  }

  paint(color, opacity) {
    this._material.color.copy(color);
    this._material.opacity = opacity;
  }

  setClipping(planes) {
    this._material.clippingPlanes = planes;
  }
}
