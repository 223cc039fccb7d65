/**
 * Clouds: a draw call each, a point of the graphics card for every ball. What is large enough on the screen is shaded and
 * set in depth as the ball that it is; the rest are squares of at least `LEAST` pixels, darker the farther away they are.
 *
 * Coordinates are 16-bit numbers in a box: the pose of the box in the scene, computed in double precision, is the matrix.
 */
import { BufferAttribute, BufferGeometry, Color, Group, Matrix4, Points, ShaderMaterial, Sphere, Vector3 } from "three";
import { INK } from "./solid_material.js";

/** Width of what is drawn for a point [pixels], at least; what looks like a ball, at least. */
const LEAST = 2.2;
const ROUND = 5.0;
/** Points without a radius are drawn as large as balls of this part of the scene are, to as many pixels. */
const POINT_SIZE = 0.0012;
const MOST = 4.0;
/** How near the pointer has to come to a point [pixels]. */
const REACH = 4;
const STEPS = 65535;
const OPAQUE = 0.9;

const VERTEX = `
  #include <clipping_planes_pars_vertex>
  uniform float radius, pointSize, pixels, ratio;
  attribute float ballRadius;
  varying float vRadius, vSize, vDepth;
  void main() {
    vec4 mvPosition = modelViewMatrix * vec4( position, 1.0 );
    #include <clipping_planes_vertex>
    gl_Position = projectionMatrix * mvPosition;
    vRadius = radius < 0.0 ? ballRadius : radius;
    vDepth = -mvPosition.z;
    float perMetre = pixels * projectionMatrix[1][1] / max( gl_Position.w, 1e-30 );
    float width = vRadius > 0.0 ? 2.0 * vRadius * perMetre : min( 2.0 * pointSize * perMetre, ${MOST.toFixed(1)} * ratio );
    vSize = max( width, ${LEAST.toFixed(1)} * ratio );
    gl_PointSize = vSize;
  }
`;
const FRAGMENT = `
  #include <clipping_planes_pars_fragment>
  uniform mat4 projectionMatrix;
  uniform vec3 color;
  uniform float colorPattern, opacity, ratio, size, distance0;
  varying float vRadius, vSize, vDepth;
  void main() {
    #include <clipping_planes_fragment>
    vec2 across = gl_PointCoord * 2.0 - 1.0;
    float square = dot( across, across );
    bool round = vSize > ${ROUND.toFixed(1)} * ratio;
    if ( round && square > 1.0 ) discard;
    vec2 pixel = gl_FragCoord.xy;
    float ink = 0.0;
    ${INK}
    float light = 1.0 - 0.5 * smoothstep( distance0 - 0.5 * size, distance0 + 0.5 * size, vDepth );
    gl_FragDepth = gl_FragCoord.z;
    if ( round && vRadius > 0.0 ) {
      float height = sqrt( 1.0 - square );
      light = 0.35 + 0.65 * dot( vec3( across.x, -across.y, height ), vec3( 0.26, 0.46, 0.85 ) );
      float z = vRadius * height - vDepth;
      float end = ( projectionMatrix[2][2] * z + projectionMatrix[3][2] ) / ( projectionMatrix[2][3] * z + projectionMatrix[3][3] );
      gl_FragDepth = clamp( 0.5 * end + 0.5, 0.0, 1.0 );
    }
    gl_FragColor = vec4( color * ( 1.0 - 0.34 * ink ) * light, opacity );
    #include <colorspace_fragment>
  }
`;

/** The points of a shape of the drawing, as they stand in the page. */
export class PointArrays {
  constructor(points, decode) {
    this.count = points.count;
    this.every = points.every;
    this.low = points.low;
    this.extent = points.extent;
    this.radius = points.radius;
    this.positions = decode(points.positions, Uint16Array);
    this.radii = points.radii === null ? null : decode(points.radii, Float32Array);
    this.largest = this.radii === null ? points.radius : this.radii.reduce((most, r) => Math.max(most, r), 0);
    this._geometry = null;
  }

  /** The corners of a box around all balls, six numbers. */
  get corners() {
    return [...this.low.map((x) => x - this.largest), ...this.low.map((x, k) => x + this.extent[k] + this.largest)];
  }

  get geometry() {
    if (this._geometry === null) {
      this._geometry = new BufferGeometry();
      this._geometry.setAttribute("position", new BufferAttribute(this.positions, 3, true));
      if (this.radii !== null) this._geometry.setAttribute("ballRadius", new BufferAttribute(this.radii, 1));
      this._geometry.boundingSphere = new Sphere(new Vector3(0.5, 0.5, 0.5), 1.0);
    }
    return this._geometry;
  }
}

export class CloudPoints {
  /** geometries : a `ShapeGeometry` for every row of the drawing's shapes.   size : of the scene [m]. */
  constructor(geometries, bodies, stage, size) {
    this.group = new Group();
    this._size = size;
    this._clouds = new Map();
    this._box = new Matrix4();
    bodies.forEach((body, row) => {
      const points = geometries[body.shown]?.points;
      if (points) this._clouds.set(row, this._add(points));
    });
    if (this._clouds.size) stage.beforeRender(() => this._follow(stage));
  }

  get count() {
    return [...this._clouds.values()].reduce((sum, { points }) => sum + points.count, 0);
  }

  _add(points) {
    const value = (number) => ({ value: number });
    const material = new ShaderMaterial({
      vertexShader: VERTEX, fragmentShader: FRAGMENT, clipping: true, transparent: true,
      uniforms: {
        radius: value(points.radii === null ? points.radius : -1), pointSize: value(POINT_SIZE * this._size), pixels: value(1),
        ratio: value(1), color: value(new Color()), colorPattern: value(0), opacity: value(1), size: value(this._size),
        distance0: value(1),
      },
    });
    const drawn = new Points(points.geometry, material);
    drawn.matrixAutoUpdate = false;
    drawn.frustumCulled = false;
    this.group.add(drawn);
    return { points, drawn, pose: new Matrix4() };
  }

  /** What depends on the camera and the picture's size, before each picture. */
  _follow(stage) {
    const ratio = stage.renderer.getPixelRatio();
    for (const { drawn } of this._clouds.values()) {
      const { uniforms } = drawn.material;
      uniforms.ratio.value = ratio;
      uniforms.pixels.value = 0.5 * stage.renderer.domElement.height;
      uniforms.distance0.value = stage.camera.position.distanceTo(stage.controls.target);
    }
  }

  setPose(row, matrix) {
    const cloud = this._clouds.get(row);
    if (!cloud) return;
    const { low, extent } = cloud.points;
    cloud.pose.copy(matrix);
    this._box.set(extent[0], 0, 0, low[0], 0, extent[1], 0, low[1], 0, 0, extent[2], low[2], 0, 0, 0, 1);
    cloud.drawn.matrix.multiplyMatrices(matrix, this._box);
    cloud.drawn.matrixWorldNeedsUpdate = true;
  }

  setLook(row, color, pattern, opacity) {
    const cloud = this._clouds.get(row);
    if (!cloud) return;
    const { material } = cloud.drawn;
    material.uniforms.color.value.set(color);
    material.uniforms.colorPattern.value = pattern;
    material.uniforms.opacity.value = opacity;
    material.depthWrite = opacity >= OPAQUE; // ghosts come after all that is opaque, and hide nothing
    cloud.drawn.renderOrder = opacity >= OPAQUE ? -1 : 1;
  }

  setClipping(planes) {
    for (const { drawn } of this._clouds.values()) drawn.material.clippingPlanes = planes;
  }

  /** The point that a ray meets first, with its body, place, distance [m] and row; null where it meets none. */
  pick(raycaster, planes, stage) {
    const height = 2 * REACH / stage.canvas.clientHeight; // of a pixel's reach at half a picture's height
    let best = null;
    for (const [body, { points, drawn, pose }] of this._clouds) {
      const hit = nearestOnRay(points, pose, raycaster.ray, stage.isOrthographic ? [height * stage.halfHeight, 0] : [0, height * stage.tangent]);
      if (!hit || (best && hit.distance >= best.distance)) continue;
      const point = raycaster.ray.at(hit.distance, new Vector3());
      if (planes.some((plane) => plane.distanceToPoint(point) < 0)) continue;
      best = { body, point, distance: hit.distance, row: hit.row, opaque: drawn.material.uniforms.opacity.value >= OPAQUE };
    }
    return best;
  }
}

/** {row, distance} of the first point that a ray passes within its radius, or within reach[0] + reach[1] · distance [m]. */
function nearestOnRay(points, pose, ray, reach) {
  const { positions, low, extent, radii, radius, every } = points;
  const { origin: o, direction: d } = ray.clone().applyMatrix4(pose.clone().invert());
  const [x0, y0, z0] = [low[0] - o.x, low[1] - o.y, low[2] - o.z];
  const [sx, sy, sz] = extent.map((length) => length / STEPS);
  let [row, first] = [-1, Infinity];
  for (let k = 0, at = 0; at < positions.length; k += 1, at += 3) {
    const [x, y, z] = [x0 + sx * positions[at], y0 + sy * positions[at + 1], z0 + sz * positions[at + 2]];
    const t = x * d.x + y * d.y + z * d.z;
    if (t <= 0 || t >= first) continue;
    const r = Math.max(radii === null ? radius : radii[k], reach[0] + reach[1] * t);
    if (x * x + y * y + z * z - t * t <= r * r) [row, first] = [k, t];
  }
  return row < 0 ? null : { row: row * every, distance: first };
}
