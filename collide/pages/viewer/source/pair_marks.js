/**
 * What is drawn about the selected pair: edges of both bodies, witness points, normal, separating translation, contacts.
 *
 * Lines lie over everything, so that no body hides them, and keep their width on the screen.
 */
import { BufferAttribute, BufferGeometry, Color, ConeGeometry, DoubleSide, Group, Mesh, MeshBasicMaterial, Quaternion, Vector3 } from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";
import { decodeArray } from "./page_data.js";

const Y = new Vector3(0, 1, 0);

export class PairMarks {
  constructor(stage) {
    this.group = new Group();
    this.group.renderOrder = 10;
    stage.scene.add(this.group);
    this._arrows = [];
    stage.beforeRender(() => this._rescale(stage));
  }

  clear() {
    for (const child of [...this.group.children]) {
      child.geometry?.dispose();
      child.material?.dispose();
      this.group.remove(child);
    }
    this._arrows = [];
  }

  /** Segments (pairs of points) as lines. dashed : length of a dash [m], 0 for a whole line. */
  addLines(points, color, width, { dashed = 0, matrix = null, onTop = true, planes = [] } = {}) {
    const geometry = new LineSegmentsGeometry().setPositions(points);
    const material = new LineMaterial({
      color, linewidth: width, dashed: dashed > 0, dashSize: dashed || 1, gapSize: dashed * 0.7 || 1,
      depthTest: !onTop, transparent: true, clippingPlanes: planes,
    });
    const lines = new LineSegments2(geometry, material);
    if (dashed) lines.computeLineDistances();
    if (matrix) lines.applyMatrix4(matrix);
    lines.renderOrder = onTop ? 11 : 3;
    this.group.add(lines);
    return lines;
  }

  /** An arrow whose tip stands at `end`; its head is as large as the screen wants, and no longer than the arrow. */
  addArrow(start, end, color, width) {
    this.addLines([...start.toArray(), ...end.toArray()], color, width);
    const head = new Mesh(new ConeGeometry(0.34, 1, 20), new MeshBasicMaterial({ color, depthTest: false, transparent: true }));
    head.renderOrder = 12;
    const along = end.clone().sub(start);
    const length = along.length();
    head.quaternion.copy(new Quaternion().setFromUnitVectors(Y, along.normalize()));
    this.group.add(head);
    this._arrows.push({ head, end: end.clone(), along, length });
  }

  /** Heads of arrows follow the zoom. */
  _rescale(stage) {
    const size = stage.halfHeight * 0.05;
    for (const { head, end, along, length } of this._arrows) {
      const tall = Math.min(size, 0.55 * length);
      head.scale.setScalar(tall);
      head.position.copy(end).addScaledVector(along, -0.5 * tall);
    }
  }

  /**
   * Contacts of a pair: patches with an arrow at each point, as long as the depth there, and what both bodies share.
   * place : takes a point of the world into the scene.   colors : of patches, of the volume.   half : see `addPatch`.
   */
  addContacts({ patches, overlap }, place, [color, ofVolume], half) {
    for (const { points, normal, depths } of patches ?? []) {
      const placed = points.map(place);
      this.addPatch(placed, color, 0.02 * half);
      placed.forEach((point, k) => {
        const length = Math.max(Math.abs(depths[k]), 0.12 * half);
        this.addArrow(point, point.clone().addScaledVector(new Vector3(...normal), length), color, 1.2);
      });
    }
    if (overlap?.triangles) this._addVolume(decodeArray(overlap.triangles, Float32Array), place(overlap.origin), ofVolume);
  }

  /** Triangles (corners one after the other, nine numbers each) about a point of the scene, filled. */
  _addVolume(corners, origin, color) {
    const geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(corners, 3));
    const fill = new Mesh(geometry, new MeshBasicMaterial({
      color: new Color(color), side: DoubleSide, transparent: true, opacity: 0.35, depthTest: false,
    }));
    fill.position.copy(origin);
    fill.renderOrder = 9;
    this.group.add(fill);
  }

  /** A contact patch: its polygon filled where it has three corners or more, its points marked. points : in the scene. */
  addPatch(points, color, size) {
    const flat = points.flatMap((point) => point.toArray());
    if (points.length > 2) {
      const geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(flat), 3));
      geometry.setIndex(Array.from({ length: points.length - 2 }, (_, k) => [0, k + 1, k + 2]).flat());
      const fill = new Mesh(geometry, new MeshBasicMaterial({
        color: new Color(color), side: DoubleSide, transparent: true, opacity: 0.45, depthTest: false,
      }));
      fill.renderOrder = 10;
      this.group.add(fill);
    }
    const outline = points.length > 1 ? points.flatMap((point, k) => [...point.toArray(), ...points[(k + 1) % points.length].toArray()]) : [];
    const crosses = points.flatMap(({ x, y, z }) => [
      x - size, y, z, x + size, y, z, x, y - size, z, x, y + size, z, x, y, z - size, x, y, z + size,
    ]);
    this.addLines([...outline, ...crosses], color, 2);
  }
}
