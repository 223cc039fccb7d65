/**
 * Triangles as three.js wants them. Where a shape is flat between its edges, normals are zero, which `solid_material.js`
 * reads as "the facet's own": vertices stay shared. Those of curved shapes are averaged over the facets around a vertex
 * that are no more than 30° off.
 */
import { BufferAttribute, BufferGeometry, EdgesGeometry } from "three";
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
    this.isEmpty = this.triangles.length === 0;
    this._solid = null;
    this._edges = undefined;
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
  const around = cornersOfVertices(triangles, positions.length / 3);
  const [points, normals] = [[], []];
  const index = new Uint32Array(triangles.length);
  const { starts, corners } = around;
  for (let vertex = 0; vertex < starts.length - 1; vertex += 1) {
    const first = points.length / 3;
    for (let k = starts[vertex]; k < starts[vertex + 1]; k += 1) {
      const normal = cornerNormal(facets, Math.floor(corners[k] / 3), around, vertex);
      let row = first;
      while (row < points.length / 3 && !isNormal(normals, row, normal)) row += 1;
      if (row === points.length / 3) {
        points.push(positions[3 * vertex], positions[3 * vertex + 1], positions[3 * vertex + 2]);
        normals.push(...normal);
      }
      index[corners[k]] = row;
    }
  }
  return geometry(new Float32Array(points), new Float32Array(normals), index);
}

/** The average over the facets around a vertex that are flat enough against this one. */
function cornerNormal(facets, facet, { starts, corners }, vertex) {
  let [x, y, z] = [0, 0, 0];
  for (let k = starts[vertex]; k < starts[vertex + 1]; k += 1) {
    const near = Math.floor(corners[k] / 3);
    if (near !== facet && cosineBetween(facets, facet, near) < COS_CREASE) continue;
    x += facets[3 * near];
    y += facets[3 * near + 1];
    z += facets[3 * near + 2];
  }
  const length = Math.hypot(x, y, z) || 1;
  return [x / length, y / length, z / length];
}

function isNormal(normals, row, normal) {
  return normal.every((c, axis) => Math.abs(normals[3 * row + axis] - c) < 1e-4);
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

function cosineBetween(normals, f, g) {
  const [i, j] = [3 * f, 3 * g];
  const inner = normals[i] * normals[j] + normals[i + 1] * normals[j + 1] + normals[i + 2] * normals[j + 2];
  const lengths = Math.hypot(normals[i], normals[i + 1], normals[i + 2]) * Math.hypot(normals[j], normals[j + 1], normals[j + 2]);
  return lengths > 0 ? inner / lengths : 1;
}
