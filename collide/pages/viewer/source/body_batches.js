/**
 * All bodies in one draw call: a batch of shapes, each stored once, and an instance a body.
 *
 * Instances are sorted anew for each picture: what is opaque from the front, then ghosts from the back.
 */
import { BatchedMesh, Box3, Matrix4, MeshBasicMaterial, Vector3, Vector4 } from "three";

/** Opacity from which a body hides what is behind it. */
const OPAQUE = 0.9;

export class BodyBatch {
  /**
   * geometries : a `ShapeGeometry` for every row of the drawing's shapes.
   * shapeOf : row of its shape for every body, null where a body has none.
   */
  constructor(geometries, shapeOf, material) {
    const rows = [...new Set(shapeOf.filter((row) => row !== null && geometries[row].hasFacets))];
    const sum = (count) => rows.reduce((total, row) => total + count(geometries[row].solid), 0);
    const vertices = sum((solid) => solid.attributes.position.count);
    this.mesh = new BatchedMesh(Math.max(1, shapeOf.length), Math.max(3, vertices), Math.max(3, sum((solid) => solid.index.count)), material);
    this.mesh.frustumCulled = false;
    const ids = new Map(rows.map((row) => [row, this.mesh.addGeometry(geometries[row].solid)]));
    this._bodies = []; // of each instance
    this._instances = shapeOf.map((row, body) => {
      if (!ids.has(row)) return null;
      this._bodies.push(body);
      return this.mesh.addInstance(ids.get(row));
    });
    this._opacities = [];
    this.mesh.setCustomSort((list) => this._sort(list));
  }

  _sort(list) {
    const opaque = (item) => this._opacities[item.index] >= OPAQUE;
    list.sort((a, b) => Number(opaque(b)) - Number(opaque(a)) || (opaque(a) ? a.z - b.z : b.z - a.z));
  }

  setPose(body, matrix) {
    if (this._instances[body] !== null) this.mesh.setMatrixAt(this._instances[body], matrix);
  }

  /** color : from `paint`. */
  setColor(body, color, opacity) {
    const instance = this._instances[body];
    if (instance === null) return;
    this._opacities[instance] = opacity;
    this.mesh.setColorAt(instance, color);
  }

  setVisible(body, visible) {
    if (this._instances[body] !== null) this.mesh.setVisibleAt(this._instances[body], visible);
  }

  /** The body that a ray meets first, of those that are no ghosts before all others; null where it meets none. */
  pick(raycaster, planes) {
    const hits = raycaster.intersectObject(this.mesh).filter((hit) => planes.every((plane) => plane.distanceToPoint(hit.point) >= 0));
    const solid = hits.find((hit) => this._opacities[hit.batchId] >= OPAQUE);
    const hit = solid ?? hits[0];
    return hit ? { body: this._bodies[hit.batchId], point: hit.point, distance: hit.distance, opaque: hit === solid } : null;
  }
}

/** The triangles of what was really tested, as lines over the bodies. */
export function wireMaterial() {
  return new MeshBasicMaterial({ wireframe: true, transparent: true, opacity: 0.8, depthWrite: false });
}

/** Color of a wire; the batch wants four numbers. */
export function wireColor(color) {
  return new Vector4(color.r, color.g, color.b, 1);
}

const corner = new Vector3();

/** The box around the box of a shape at a pose. */
export function boxAt(geometry, matrix) {
  const { box } = geometry;
  const placed = new Box3();
  for (let k = 0; k < 8; k += 1) {
    corner.set(k & 1 ? box.max.x : box.min.x, k & 2 ? box.max.y : box.min.y, k & 4 ? box.max.z : box.min.z);
    placed.expandByPoint(corner.applyMatrix4(matrix));
  }
  return placed;
}

/** A pose as the scene has it, from row-major numbers in the world; the scene's origin is `origin`. */
export function poseMatrix(numbers, origin) {
  const [a, b, c, x, d, e, f, y, g, h, i, z] = numbers;
  return new Matrix4().set(a, b, c, x - origin[0], d, e, f, y - origin[1], g, h, i, z - origin[2], 0, 0, 0, 1);
}
