/**
 * Triangles as three.js wants them. Where a shape is flat between its edges, normals are zero, which `solid_material.js`
 * reads as "the facet's own": vertices stay shared. Those of curved shapes are averaged over the facets around a vertex
 * that are no more than 30° off.
 */
import { Box3, BufferAttribute, BufferGeometry, EdgesGeometry } from "three";
import { PointArrays } from "./cloud_points.js";
import { decodeArray } from "./page_data.js";

const COS_CREASE = Math.cos(Math.PI / 6);
/** Edges are drawn of shapes with no more triangles than this: on finer ones they hide the shape. */
const MAX_TRIANGLES_WITH_EDGES = 3000;

export class ShapeGeometry {
  constructor(shape) {
    this.smooth = shape.smooth;
    this.unbounded = shape.unbounded;
    this.positions = decodeArray(shape.positions, Float32Array);
    this.triangles = decodeArray(shape.triangles, Uint32Array);
    this.points = shape.points ? new PointArrays(shape.points, decodeArray) : null;
    this.hasFacets = this.triangles.length > 0;
    this.isEmpty = !this.hasFacets && this.points === null;
    this._box = null;
    this._solid = null;
    this._edges = undefined;
  }

  /** The box around all vertices and balls, in the shape's frame. */
  get box() {
    if (this._box === null) {
      this._box = new Box3().setFromArray(this.positions);
      if (this.points !== null) this._box.union(new Box3().setFromArray(this.points.corners));
    }
    return this._box;
  }

  /** Indexed triangles with normals. */
  get solid() {
    this._solid ??= this.smooth ? curvedGeometry(this.positions, this.triangles) : flatGeometry(this.positions, this.triangles);
    return this._solid;
  }

  /** Segments of edges where facets meet at an angle (pairs of points), null of shapes with too many facets. */
  get edges() {
    if (this._edges === undefined) {
      const few = this.triangles.length <= 3 * MAX_TRIANGLES_WITH_EDGES;
      this._edges = few ? new EdgesGeometry(flatGeometry(this.positions, this.triangles), 25).attributes.position.array : null;
    }
    return this._edges;
  }
}

function flatGeometry(positions, triangles) {
  return geometry(positions, new Float32Array(positions.length), triangles);
}

function geometry(positions, normals, triangles) {
  const made = new BufferGeometry();
  made.setAttribute("position", new BufferAttribute(positions, 3));
  made.setAttribute("normal", new BufferAttribute(normals, 3));
  made.setIndex(new BufferAttribute(triangles, 1));
  return made;
}

/** Vertices with averaged normals: one for each normal that the facets around a vertex see. */
function curvedGeometry(positions, triangles) {
  const facets = facetNormals(positions, triangles);
  const directions = unitRows(facets);
  const { starts, corners } = cornersOfVertices(triangles, positions.length / 3);
  const points = new Float32Array(3 * triangles.length); // as many as there are corners, at most
  const normals = new Float32Array(3 * triangles.length);
  const index = new Uint32Array(triangles.length);
  const normal = new Float32Array(3);
  let rows = 0;
  for (let vertex = 0; vertex < starts.length - 1; vertex += 1) {
    const first = rows;
    for (let k = starts[vertex]; k < starts[vertex + 1]; k += 1) {
      const around = corners.subarray(starts[vertex], starts[vertex + 1]);
      putCornerNormal(normal, facets, directions, facetOf(corners[k]), around);
      let row = first;
      while (row < rows && !isNormal(normals, row, normal)) row += 1;
      if (row === rows) {
        points.set(positions.subarray(3 * vertex, 3 * vertex + 3), 3 * row);
        normals.set(normal, 3 * row);
        rows += 1;
      }
      index[corners[k]] = row;
    }
  }
  return geometry(points.slice(0, 3 * rows), normals.slice(0, 3 * rows), index);
}

/** The average over the facets of corners at one vertex that are flat enough against one of them; all, if it has no area. */
function putCornerNormal(normal, facets, directions, own, corners) {
  const all = innerProduct(directions, own, own) === 0;
  let [x, y, z] = [0, 0, 0];
  for (let k = 0; k < corners.length; k += 1) {
    const near = facetOf(corners[k]);
    if (!all && near !== own && innerProduct(directions, own, near) < COS_CREASE) continue;
    x += facets[near];
    y += facets[near + 1];
    z += facets[near + 2];
  }
  const length = Math.sqrt(x * x + y * y + z * z) || 1;
  normal[0] = x / length;
  normal[1] = y / length;
  normal[2] = z / length;
}

/** Where the numbers of a corner's facet begin: a facet has three corners, and its normal three numbers. */
function facetOf(corner) {
  return corner - (corner % 3);
}

function innerProduct(rows, i, j) {
  return rows[i] * rows[j] + rows[i + 1] * rows[j + 1] + rows[i + 2] * rows[j + 2];
}

function isNormal(normals, row, normal) {
  for (let axis = 0; axis < 3; axis += 1) if (Math.abs(normals[3 * row + axis] - normal[axis]) >= 1e-4) return false;
  return true;
}

/** Normals of facets, as long as twice their areas. */
function facetNormals(p, triangles) {
  const normals = new Float32Array(triangles.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]];
    const [ux, uy, uz] = [p[b] - p[a], p[b + 1] - p[a + 1], p[b + 2] - p[a + 2]];
    const [vx, vy, vz] = [p[c] - p[a], p[c + 1] - p[a + 1], p[c + 2] - p[a + 2]];
    normals[t] = uy * vz - uz * vy;
    normals[t + 1] = uz * vx - ux * vz;
    normals[t + 2] = ux * vy - uy * vx;
  }
  return normals;
}

/** For every vertex the corners of facets that are at it: `corners[starts[v] … starts[v + 1]]`. */
function cornersOfVertices(triangles, n) {
  const starts = new Uint32Array(n + 1);
  for (const vertex of triangles) starts[vertex + 1] += 1;
  for (let v = 0; v < n; v += 1) starts[v + 1] += starts[v];
  const next = starts.slice(0, n);
  const corners = new Uint32Array(triangles.length);
  for (let corner = 0; corner < triangles.length; corner += 1) {
    corners[next[triangles[corner]]] = corner;
    next[triangles[corner]] += 1;
  }
  return { starts, corners };
}

/** Rows of three numbers brought to length 1; zeros stay zeros. */
function unitRows(rows) {
  const units = new Float32Array(rows.length);
  for (let k = 0; k < rows.length; k += 3) {
    const length = Math.sqrt(innerProduct(rows, k, k)) || 1;
    for (let axis = 0; axis < 3; axis += 1) units[k + axis] = rows[k + axis] / length;
  }
  return units;
}
