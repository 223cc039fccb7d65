/**
 * Renderer, cameras and controls. A picture is made when something changed, never in a loop.
 *
 * The scene's own origin is the middle of what is drawn: graphics cards compute in single precision.
 */
import {
  AmbientLight, DirectionalLight, Group, OrthographicCamera, PerspectiveCamera, Plane, Raycaster, Scene, Spherical, Vector2,
  Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const FIELD_OF_VIEW = 40;
/** Of the camera around the target, for each press of a key. */
const STEP = Math.PI / 24;

export class Stage {
  /**
   * size : extent of the scene [m].   smooth : whether edges are smoothed, which costs most where facets are many.
   * Throws where the browser has no WebGL.
   */
  constructor(canvas, size, smooth = true) {
    this.canvas = canvas;
    this.size = size;
    this.renderer = new WebGLRenderer({ canvas, antialias: smooth, powerPreference: "high-performance" });
    this.renderer.localClippingEnabled = true;
    // asking for a shader's log waits until it is compiled: a second where the processor draws
    this.renderer.debug.checkShaderErrors = false;
    this.scene = new Scene();
    this._perspective = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 100);
    this._orthographic = new OrthographicCamera(-1, 1, 1, -1, -100, 100);
    this.camera = this._perspective;
    for (const camera of [this._perspective, this._orthographic]) camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.requestRender());
    this._light();
    this._preparers = [];
    this._followers = [];
    this._requested = false;
    this._sized = { width: 0, height: 0 };
    new ResizeObserver(() => this.requestRender()).observe(canvas.parentElement);
  }

  _light() {
    // the lamps go where the camera goes: no side of a body is ever in the dark
    this._lamps = new Group();
    const lamp = new DirectionalLight(0xffffff, 1.9);
    lamp.position.set(0.5, 0.9, 1.6);
    const second = new DirectionalLight(0xffffff, 0.7);
    second.position.set(-1.2, -0.4, 0.6);
    this._lamps.add(lamp, lamp.target, second, second.target);
    this.scene.add(this._lamps, new AmbientLight(0xffffff, 1.5));
  }

  /** Calls `follower(stage)` before each picture. */
  beforeRender(follower) {
    this._preparers.push(follower);
  }

  /** Calls `follower(stage)` after each picture. */
  afterRender(follower) {
    this._followers.push(follower);
  }

  requestRender() {
    if (this._requested) return;
    this._requested = true;
    requestAnimationFrame(() => this.render());
  }

  render() {
    this._requested = false;
    this.fitCanvas();
    this._setDepthRange();
    this._lamps.quaternion.copy(this.camera.quaternion);
    this._lamps.position.copy(this.camera.position);
    for (const prepare of this._preparers) prepare(this);
    this.renderer.render(this.scene, this.camera);
    for (const follower of this._followers) follower(this);
  }

  /** Takes over the size of the frame around the canvas. */
  fitCanvas() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (width === this._sized.width && height === this._sized.height) return;
    this._sized = { width, height };
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    this.renderer.setSize(Math.max(1, width), Math.max(1, height));
    this._perspective.aspect = width / Math.max(1, height);
    this._setFrustum(this._orthographic.top);
  }

  get aspect() {
    return this._perspective.aspect;
  }

  _setFrustum(halfHeight) {
    const half = Math.max(halfHeight, 1e-9);
    Object.assign(this._orthographic, { top: half, bottom: -half, left: -half * this.aspect, right: half * this.aspect });
    this._orthographic.updateProjectionMatrix();
    this._perspective.updateProjectionMatrix();
  }

  _setDepthRange() {
    const distance = this.camera.position.distanceTo(this.controls.target);
    const far = this.camera.position.length() + 4 * this.size + distance;
    this.camera.near = this.camera.isOrthographicCamera ? -far : Math.max(distance * 0.02, far * 1e-6);
    this.camera.far = far;
    this.camera.updateProjectionMatrix();
  }

  get isOrthographic() {
    return this.camera.isOrthographicCamera === true;
  }

  /** Half the height that is seen at a distance of one. */
  get tangent() {
    return Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
  }

  /** Half the height [m] of what is seen at the target. */
  get halfHeight() {
    if (this.isOrthographic) return this._orthographic.top / this._orthographic.zoom;
    return this.camera.position.distanceTo(this.controls.target) * this.tangent;
  }

  /** Looks at `target` along `-direction`, with `halfHeight` [m] seen above and below it. */
  look(target, direction, halfHeight) {
    const distance = halfHeight / this.tangent;
    this.controls.target.copy(target);
    this.camera.position.copy(target).addScaledVector(direction, distance);
    this._orthographic.zoom = 1;
    this._setFrustum(halfHeight);
    this.controls.update();
    this.requestRender();
  }

  /** Perspective or parallel lines; what is seen at the target stays as large. */
  setOrthographic(parallel) {
    if (parallel === this.isOrthographic) return;
    const half = this.halfHeight;
    const direction = this.direction;
    this.camera = parallel ? this._orthographic : this._perspective;
    this.controls.object = this.camera;
    this.look(this.controls.target.clone(), direction, half);
  }

  /** Unit vector from the target to the camera. */
  get direction() {
    return this.camera.position.clone().sub(this.controls.target).normalize();
  }

  /** A step around the target, to the right and upwards, and nearer or farther: from the keyboard. */
  orbit(right, up, zoom) {
    const angles = new Spherical().setFromVector3(new Vector3(this.direction.x, this.direction.z, -this.direction.y));
    angles.theta += right * STEP;
    angles.phi = Math.min(Math.PI - 0.01, Math.max(0.01, angles.phi - up * STEP));
    const { x, y, z } = new Vector3().setFromSpherical(angles);
    this.look(this.controls.target.clone(), new Vector3(x, -z, y), this.halfHeight * zoom);
  }

  /** A step of the target across the picture. */
  pan(right, up) {
    const across = new Vector3(0, 0, 1).cross(this.direction).normalize();
    const upwards = this.direction.cross(across).normalize();
    const step = 0.15 * this.halfHeight;
    const target = this.controls.target.clone().addScaledVector(across, right * step).addScaledVector(upwards, up * step);
    this.look(target, this.direction, this.halfHeight);
  }

  /** A ray through a place on the screen (client coordinates). */
  rayThrough(x, y) {
    const bounds = this.canvas.getBoundingClientRect();
    const at = new Vector2(((x - bounds.left) / bounds.width) * 2 - 1, 1 - ((y - bounds.top) / bounds.height) * 2);
    const raycaster = new Raycaster();
    raycaster.setFromCamera(at, this.camera);
    return raycaster;
  }

  /** Where a point of the scene is in the canvas [CSS pixels], null where it is behind the camera. */
  project(point) {
    const at = new Vector3().copy(point).project(this.camera);
    if (at.z > 1 || at.z < -1) return null;
    return { x: ((at.x + 1) / 2) * this._sized.width, y: ((1 - at.y) / 2) * this._sized.height };
  }

  /** A plane for sections, in the scene's coordinates. */
  static plane() {
    return new Plane(new Vector3(1, 0, 0), 0);
  }
}
