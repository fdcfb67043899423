/** Performers: their skeletons, their numbers, and which characters they control. */

import * as THREE from "three";

import { JOINT_PARENTS, type Body } from "../reader/index.js";

/** sRGB of performers 1, 2, 3, ...; the same as in enliven's viewer. */
export const PERFORMER_COLOURS = ["#60e2de", "#ffc45c", "#c4a0ff", "#96eb82"];
/** Joints and bones below this confidence are not drawn. */
const MIN_CONFIDENCE = 0.15;
const HEAD = 3;
const BONE_RADIUS_M = 0.017;
const JOINT_RADIUS_M = 0.03;

/** Small numbers for performers, from 1 on. An edge gives a new id to a performer that it finds again. */
export class PerformerNumbers {
  private numbers = new Map<number, number>();

  /** Frees the numbers of all other performers, and gives the lowest free number to each new one. */
  see(ids: Iterable<number>): void {
    const present = [...new Set(ids)].sort((a, b) => a - b);
    this.numbers = new Map([...this.numbers].filter(([id]) => present.includes(id)));
    for (const id of present) this.of(id);
  }

  /** Returns the number of a performer. */
  of(id: number): number {
    const known = this.numbers.get(id);
    if (known !== undefined) return known;
    const taken = new Set(this.numbers.values());
    let number = 1;
    while (taken.has(number)) number++;
    this.numbers.set(id, number);
    return number;
  }
}

/** Returns the colour of a performer, as CSS. */
export const performerColour = (number: number): string =>
  PERFORMER_COLOURS[(number - 1) % PERFORMER_COLOURS.length];

/** The skeletons of all performers in view, as translucent sticks. Add `group` to a scene. */
export class Skeletons {
  readonly group = new THREE.Group();
  private readonly sticks = new THREE.CylinderGeometry(BONE_RADIUS_M, BONE_RADIUS_M, 1, 10).translate(0, 0.5, 0);
  private readonly balls = new THREE.SphereGeometry(JOINT_RADIUS_M, 14, 10);
  private readonly shown = new Map<number, { bones: THREE.InstancedMesh; joints: THREE.InstancedMesh }>();

  /** Shows these performers. */
  show(bodies: Body[], numbers: PerformerNumbers): void {
    for (const [id, { bones, joints }] of this.shown) {
      if (bodies.some((body) => body.id === id)) continue;
      for (const mesh of [bones, joints]) {
        mesh.removeFromParent();
        mesh.dispose();
      }
      this.shown.delete(id);
    }
    for (const body of bodies) {
      const meshes = this.shown.get(body.id) ?? this.create(body.id);
      const colour = new THREE.Color(performerColour(numbers.of(body.id)));
      for (const mesh of [meshes.bones, meshes.joints]) (mesh.material as THREE.MeshStandardMaterial).color = colour;
      place(body, meshes.bones, meshes.joints);
    }
  }

  /** Returns the place of a number above a performer's head. */
  static labelPlace(body: Body): THREE.Vector3 {
    const at = 3 * HEAD;
    return new THREE.Vector3(body.joints[at], body.joints[at + 1] + 0.22, body.joints[at + 2]);
  }

  private create(id: number): { bones: THREE.InstancedMesh; joints: THREE.InstancedMesh } {
    const make = (geometry: THREE.BufferGeometry, count: number): THREE.InstancedMesh => {
      const material = new THREE.MeshStandardMaterial({ transparent: true, opacity: 0.5, roughness: 0.6 });
      const mesh = new THREE.InstancedMesh(geometry, material, count);
      mesh.frustumCulled = false;
      mesh.castShadow = true;
      this.group.add(mesh);
      return mesh;
    };
    const meshes = { bones: make(this.sticks, JOINT_PARENTS.length - 1), joints: make(this.balls, JOINT_PARENTS.length) };
    this.shown.set(id, meshes);
    return meshes;
  }
}

/** Places the sticks and balls of one performer. Uncertain ones get no size. */
function place(body: Body, bones: THREE.InstancedMesh, joints: THREE.InstancedMesh): void {
  const points = JOINT_PARENTS.map((_, joint) => new THREE.Vector3().fromArray(body.joints, 3 * joint));
  const up = new THREE.Vector3(0, 1, 0);
  const none = new THREE.Matrix4().makeScale(0, 0, 0);
  JOINT_PARENTS.forEach((parent, joint) => {
    const isCertain = body.confidence[joint] >= MIN_CONFIDENCE;
    const ball = new THREE.Matrix4().makeTranslation(points[joint]);
    joints.setMatrixAt(joint, isCertain ? ball : none);
    if (parent < 0) return;
    const along = points[joint].clone().sub(points[parent]);
    const length = along.length();
    const isShown = isCertain && body.confidence[parent] >= MIN_CONFIDENCE && length > 1e-6;
    const turn = new THREE.Quaternion().setFromUnitVectors(up, along.divideScalar(length || 1));
    const stick = new THREE.Matrix4().compose(points[parent], turn, new THREE.Vector3(1, length, 1));
    bones.setMatrixAt(joint - 1, isShown ? stick : none);
  });
  bones.instanceMatrix.needsUpdate = joints.instanceMatrix.needsUpdate = true;
}
