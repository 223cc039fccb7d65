/** Axes of bodies: x, y and z from the origin of each, in the colours of the picture's own axes, over everything. */
import { BufferGeometry, Color, Float32BufferAttribute, LineBasicMaterial, LineSegments, Vector3 } from "three";
import { AXES } from "./scene_labels.js";

export class BodyFrames {
  /** length : of an axis [m]. */
  constructor(stage, length) {
    this._length = length;
    const material = new LineBasicMaterial({ vertexColors: true, depthTest: false, transparent: true });
    this._lines = new LineSegments(new BufferGeometry(), material);
    this._lines.renderOrder = 9;
    this._lines.frustumCulled = false;
    this.set([]);
    stage.scene.add(this._lines);
  }

  /** Draws these frames and no others: poses of bodies in the scene. */
  set(matrices) {
    this.count = matrices.length;
    const ends = matrices.flatMap((matrix) => [0, 1, 2].flatMap((axis) => [
      ...new Vector3().setFromMatrixPosition(matrix).toArray(),
      ...new Vector3().setComponent(axis, this._length).applyMatrix4(matrix).toArray(),
    ]));
    const shades = AXES.flatMap(([, , color]) => [...new Color(color).toArray(), ...new Color(color).toArray()]);
    this._lines.geometry.dispose();
    this._lines.geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(ends, 3))
      .setAttribute("color", new Float32BufferAttribute(matrices.flatMap(() => shades), 3));
    this._lines.visible = this.count > 0;
  }
}
