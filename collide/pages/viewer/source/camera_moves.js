/** Where the camera goes: standard views, a fit, a pair of bodies. It flies there, unless motion is not wanted. */
import { Box3, Ray, Vector3 } from "three";

const SECONDS = 0.35;

/** Directions from the target to the camera. Top and bottom are tilted by what keeps north up. */
export const VIEWS = {
  front: new Vector3(0, -1, 0),
  side: new Vector3(1, 0, 0),
  top: new Vector3(0, -1e-4, 1).normalize(),
  iso: new Vector3(0.8, -1, 0.62).normalize(),
};

/** Corners that a first picture may be seen from, the best liked first. */
const CORNERS = [[1, 1], [-1, 1], [1, -1], [-1, -1]].map(([x, y]) => new Vector3(x * VIEWS.iso.x, y * VIEWS.iso.y, VIEWS.iso.z));
/** Boxes looked at for that: every so many of a large scene. */
const MAX_BOXES = 200;

/** The corner from which the fewest middles of boxes are hidden behind other boxes: walls are looked at from inside. */
export function clearestCorner(boxes) {
  const seen = boxes.filter((_, k) => k % Math.ceil(boxes.length / MAX_BOXES) === 0);
  const middles = seen.map((box) => box.getCenter(new Vector3()));
  const hidden = (direction) => middles.filter((middle, k) => {
    const ray = new Ray(middle, direction);
    return seen.some((box, other) => other !== k && !box.containsPoint(middle) && ray.intersectsBox(box));
  }).length;
  const counts = CORNERS.map(hidden);
  // another corner than the usual one only where it shows much more
  const best = counts.indexOf(Math.min(...counts));
  return CORNERS[counts[0] > counts[best] + 0.1 * seen.length ? best : 0];
}

export class CameraMoves {
  constructor(stage) {
    this._stage = stage;
    this._flight = 0;
    this.isFlying = false;
  }

  /** Flies to a view of `target` [scene], along −direction, `halfHeight` [m] above and below it. */
  fly(target, direction, halfHeight) {
    const stage = this._stage;
    const [target0, direction0, half0] = [stage.controls.target.clone(), stage.direction, stage.halfHeight];
    const flight = (this._flight += 1);
    const end = direction.clone().normalize();
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) {
      stage.look(target, end, halfHeight);
      return;
    }
    const start = performance.now();
    this.isFlying = true;
    const step = (now) => {
      if (flight !== this._flight) return;
      const t = Math.min(1, Math.max(0, (now - start) / 1000 / SECONDS));
      const s = t * t * (3 - 2 * t);
      const half = half0 * (halfHeight / half0) ** s;
      stage.look(target0.clone().lerp(target, s), turned(direction0, end, s), half);
      this.isFlying = t < 1;
      if (this.isFlying) requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  /** All of the boxes, from a direction. */
  fit(boxes, direction = this._stage.direction) {
    const around = new Box3();
    for (const box of boxes) around.union(box);
    if (around.isEmpty()) return;
    const target = around.getCenter(new Vector3());
    this.fly(target, direction, this.halfHeightOf(boxes, target, direction));
  }

  /** Half the height that shows every corner of the boxes from a direction, with a little space around. */
  halfHeightOf(boxes, target, direction) {
    const { tangent, isOrthographic, aspect } = this._stage;
    const right = new Vector3(0, 0, 1).cross(direction).normalize();
    const up = direction.clone().cross(right).normalize();
    let half = 0;
    for (const corner of boxes.flatMap(cornersOf)) {
      corner.sub(target);
      const size = Math.max(Math.abs(corner.dot(up)), Math.abs(corner.dot(right)) / Math.max(0.2, aspect));
      // in perspective what is nearer than the target looks larger
      half = Math.max(half, isOrthographic ? size : size + corner.dot(direction) * tangent);
    }
    return 1.08 * half || 1;
  }

  /** A pair at a point, its normal seen from the side: depth and gap are seen at their full length, and all of the boxes. */
  flyToPair(point, normal, boxes) {
    const direction = fromTheSide(this._stage.direction, normal);
    // what is looked at lies between the point and the middle of the boxes: both stay in the picture
    const around = boxes.reduce((all, box) => all.union(box), new Box3());
    const target = around.isEmpty() ? point : point.clone().lerp(around.getCenter(new Vector3()), 0.5);
    this.fly(target, direction, this.halfHeightOf([...boxes, new Box3(point.clone(), point.clone())], target, direction));
  }
}

/** The direction nearest to this one that is at a right angle to the normal, a little from above. */
function fromTheSide(direction, normal) {
  const side = direction.clone().addScaledVector(normal, -direction.dot(normal));
  if (side.lengthSq() < 0.02) side.set(0.8, -1, 0.3).addScaledVector(normal, -normal.dot(new Vector3(0.8, -1, 0.3)));
  side.normalize();
  // bodies are read better from a little above; a normal that points up keeps its length all but 5 %
  return side.z < 0.3 ? side.add(new Vector3(0, 0, 0.3 - side.z)).normalize() : side;
}

export function cornersOf({ min, max }) {
  return Array.from({ length: 8 }, (_, k) => new Vector3(k & 1 ? max.x : min.x, k & 2 ? max.y : min.y, k & 4 ? max.z : min.z));
}

function turned(a, b, s) {
  const mixed = a.clone().lerp(b, s);
  // directions opposite to each other have no way between them: go around
  if (mixed.lengthSq() < 1e-4) mixed.add(new Vector3(a.y + 0.1, -a.x, 0.1).multiplyScalar(0.5));
  return mixed.normalize();
}
