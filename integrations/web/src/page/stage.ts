/** The stage: floor, light, camera, and the picture, which is drawn only if something has changed. */

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

/** Initial azimuth and elevation of the camera in radians, as in enliven's own viewer. */
const AZIMUTH = (32 * Math.PI) / 180;
const ELEVATION = (13 * Math.PI) / 180;
/** Vertical field of view in degrees. */
const FIELD_OF_VIEW = 35;
/** Empty space around the characters, as a multiple of their size. */
const MARGIN = 1.25;
/** Largest number of device pixels for each pixel of the page: more costs phones much, and is not visible. */
const MAX_PIXEL_RATIO = 2;
/** Pixels of a side of the shadow map: for large pictures, and for those of phones and small windows. */
const SHADOW_SIZE = 2048;
const SMALL_SHADOW_SIZE = 1024;
/** Pixels of the shorter side of a small picture. */
const SMALL_PICTURE = 600;
/** Seconds in which the camera covers 63 % of the way to a new view. */
const EASING_S = 0.35;

/** Floor with lines every half metre, which fades out into the backdrop. */
function makeFloor(): THREE.Mesh {
  const material = new THREE.MeshStandardMaterial({ color: 0x44474c, roughness: 0.95, transparent: true });
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", "#include <common>\nvarying vec3 vFloor;")
      .replace("#include <begin_vertex>", "#include <begin_vertex>\nvFloor = (modelMatrix * vec4(position, 1.0)).xyz;");
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", `#include <common>
        varying vec3 vFloor;
        float lines(vec2 p, float spacing, float width) {
          vec2 pixel = fwidth(p);
          vec2 away = abs(fract(p / spacing - 0.5) - 0.5) * spacing;
          vec2 cover = clamp((0.5 * max(vec2(width), pixel) + 0.5 * pixel - away) / pixel, 0.0, 1.0);
          cover *= min(width / pixel, 1.0);
          return max(cover.x, cover.y);
        }`)
      .replace("#include <color_fragment>", `#include <color_fragment>
        diffuseColor.rgb += 0.020 * lines(vFloor.xz, 0.5, 0.006) + 0.045 * lines(vFloor.xz, 1.0, 0.010);
        diffuseColor.a = 1.0 - smoothstep(0.25, 1.0, length(vFloor.xz) / 12.0);`);
  };
  const floor = new THREE.Mesh(new THREE.CircleGeometry(12, 64).rotateX(-Math.PI / 2), material);
  floor.receiveShadow = true;
  floor.position.y = -0.001;
  return floor;
}

/** The scene and its camera. Add figures to `scene`, and call `invalidate` after every change. */
export class Stage {
  readonly scene = new THREE.Scene();
  readonly camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, 0.05, 100);
  readonly renderer: THREE.WebGLRenderer;
  readonly controls: OrbitControls;
  /** Called before each picture, with the time in seconds. Returns true if another picture is needed. */
  readonly beforeDraw: ((now: number) => boolean)[] = [];
  /** Called when the size of the picture has changed. */
  resized: () => void = () => {};
  /** Called after each picture. */
  readonly afterDraw: (() => void)[] = [];
  /** True once the user has moved the camera: then it no longer follows the characters. */
  isHeld = false;
  /** Number of pictures so far. */
  pictures = 0;
  private readonly key = new THREE.DirectionalLight(0xffefdc, 3.4);
  private wanted: { target: THREE.Vector3; distance: number } | null = null;
  private isDirty = true;
  private last = 0;

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.renderer.toneMapping = THREE.ACESFilmicToneMapping;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.addLights();
    this.scene.add(makeFloor());
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.12;
    this.controls.maxPolarAngle = Math.PI / 2 - 0.02;
    this.controls.minDistance = 0.3;
    this.controls.maxDistance = 25;
    this.controls.addEventListener("start", () => (this.isHeld = true));
    this.controls.addEventListener("change", () => this.invalidate());
    this.lookAt(new THREE.Vector3(0, 0.8, 0), 4);
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
    this.renderer.setAnimationLoop((ms) => this.step(ms / 1000));
  }

  /** Requests a picture. */
  invalidate(): void {
    this.isDirty = true;
  }

  /** Moves the camera so that a box fills the picture: at once, or smoothly. */
  frame(box: THREE.Box3, isAtOnce = false): void {
    if (box.isEmpty()) return;
    const target = box.getCenter(new THREE.Vector3());
    const distance = this.fittingDistance(box, target);
    this.wanted = { target, distance };
    if (isAtOnce) {
      this.lookAt(target, distance);
      this.wanted = null;
    }
    this.placeLight(box);
    this.invalidate();
  }

  /** Returns the distance at which the box fills the picture, from the current direction of the camera. */
  private fittingDistance(box: THREE.Box3, target: THREE.Vector3): number {
    const back = this.camera.position.clone().sub(this.controls.target).normalize();
    const right = new THREE.Vector3(0, 1, 0).cross(back).normalize();
    const up = back.clone().cross(right);
    const tangent = Math.tan((this.camera.fov * Math.PI) / 360) / MARGIN;
    let distance = 0.5;
    for (let corner = 0; corner < 8; corner++) {
      const point = new THREE.Vector3(
        corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y, corner & 4 ? box.max.z : box.min.z,
      ).sub(target);
      const across = Math.abs(point.dot(right)) / (tangent * this.camera.aspect);
      distance = Math.max(distance, point.dot(back) + Math.max(across, Math.abs(point.dot(up)) / tangent));
    }
    return distance;
  }

  /** Follows the characters again, from the initial direction. */
  reset(): void {
    this.isHeld = false;
    this.lookAt(this.controls.target.clone(), this.camera.position.distanceTo(this.controls.target));
  }

  /** Points the key light at a box, so that the shadow map has no pixels to spare. */
  placeLight(box: THREE.Box3): void {
    const centre = box.getCenter(new THREE.Vector3());
    const radius = Math.max(box.getSize(new THREE.Vector3()).length() / 2, 0.5) * 1.3;
    this.key.target.position.copy(centre);
    this.key.position.copy(centre).add(new THREE.Vector3(0.45, 0.8, 0.4).normalize().multiplyScalar(3 * radius));
    const lens = this.key.shadow.camera;
    [lens.left, lens.right, lens.bottom, lens.top] = [-radius, radius, -radius, radius];
    [lens.near, lens.far] = [0.1, 6 * radius];
    lens.updateProjectionMatrix();
  }

  private lookAt(target: THREE.Vector3, distance: number): void {
    const level = Math.cos(ELEVATION);
    const back = new THREE.Vector3(Math.sin(AZIMUTH) * level, Math.sin(ELEVATION), Math.cos(AZIMUTH) * level);
    this.controls.target.copy(target);
    this.camera.position.copy(target).addScaledVector(back, distance);
    this.controls.update();
    this.invalidate();
  }

  private addLights(): void {
    this.key.castShadow = true;
    this.key.shadow.bias = -0.0005;
    this.key.shadow.normalBias = 0.01;
    this.key.shadow.radius = 5;
    const rim = new THREE.DirectionalLight(0x9fc2ff, 1.1);
    rim.position.set(-3, 2.2, -4);
    this.scene.add(this.key, this.key.target, rim, new THREE.HemisphereLight(0xc6d0e2, 0x5d5248, 1.45));
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, MAX_PIXEL_RATIO));
    this.renderer.setSize(clientWidth, clientHeight, false);
    const shadowSize = Math.min(clientWidth, clientHeight) < SMALL_PICTURE ? SMALL_SHADOW_SIZE : SHADOW_SIZE;
    if (this.key.shadow.mapSize.x !== shadowSize) {
      this.key.shadow.mapSize.set(shadowSize, shadowSize);
      // three.js makes the map again in the new size.
      this.key.shadow.map?.dispose();
      this.key.shadow.map = null;
    }
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    this.resized();
    this.invalidate();
  }

  private step(now: number): void {
    const passed = Math.min(now - this.last, 0.1);
    this.last = now;
    for (const callback of this.beforeDraw) if (callback(now)) this.isDirty = true;
    if (this.wanted !== null && !this.isHeld) this.ease(passed);
    this.controls.update();
    if (!this.isDirty) return;
    this.isDirty = false;
    this.renderer.render(this.scene, this.camera);
    this.pictures++;
    for (const callback of this.afterDraw) callback();
  }

  /** Moves the camera a part of the way to the wanted view. */
  private ease(passed: number): void {
    const { target, distance } = this.wanted!;
    const share = 1 - Math.exp(-passed / EASING_S);
    const back = this.camera.position.clone().sub(this.controls.target);
    const length = back.length() + share * (distance - back.length());
    if (this.controls.target.distanceTo(target) + Math.abs(length - distance) < 0.002) this.wanted = null;
    this.controls.target.lerp(target, share);
    this.camera.position.copy(this.controls.target).addScaledVector(back.normalize(), length);
    this.invalidate();
  }
}
