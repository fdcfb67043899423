/** A character on the stage: its mesh, skinned on the GPU by the transforms of the newest pose. */

import * as THREE from "three";

import { skinVertices, writeMatrices, type Character, type Pose } from "../reader/index.js";
import { buildGeometry, type CharacterGeometry } from "./geometry.js";
import { MaterialLoader, plainMaterial } from "./materials.js";

/** A skeleton whose matrices are those of poses. The bones only tell three.js how many matrices there are. */
class PoseSkeleton extends THREE.Skeleton {
  constructor(count: number) {
    super(Array.from({ length: count }, () => new THREE.Bone()));
    this.computeBoneTexture();
  }

  /** Keeps the matrices: three.js calls this in every frame to compute them from bones. */
  override update(): void {}

  /** Uses the matrices that have been written to `boneMatrices`. */
  upload(): void {
    if (this.boneTexture !== null) this.boneTexture.needsUpdate = true;
  }
}

/** One revision of a character on the stage. Add `mesh` to a scene. */
export class Figure {
  readonly mesh: THREE.SkinnedMesh;
  private readonly built: CharacterGeometry;
  private readonly skeleton: PoseSkeleton;
  private readonly loader: MaterialLoader | null;
  private newest: Pose | null = null;
  private solved: Float32Array | null = null;

  constructor(readonly character: Character, changed: () => void) {
    this.built = buildGeometry(character);
    const { materials } = character;
    this.loader = materials === null ? null : new MaterialLoader(materials, changed);
    const used = this.built.materials.map((number) => this.loader?.load(number) ?? plainMaterial());
    this.mesh = new THREE.SkinnedMesh(this.built.geometry, used);
    this.skeleton = new PoseSkeleton(character.pivots.length / 3);
    // Both matrices are identities: a pose contains complete matrices from rest to world.
    this.mesh.bind(this.skeleton, new THREE.Matrix4());
    this.mesh.frustumCulled = false;
    this.mesh.castShadow = this.mesh.receiveShadow = true;
    this.mesh.name = character.id;
    this.mesh.visible = false;
  }

  /** Shows the character in a pose. */
  show(pose: Pose): void {
    this.newest = pose;
    if (this.solved !== null) return;
    writeMatrices(pose, this.character.pivots, this.skeleton.boneMatrices as Float32Array);
    this.skeleton.upload();
    this.mesh.visible = true;
  }

  /** Shows 3 V solved vertices, world frame, instead of a pose: for meshes that control points drive. */
  showSurface(vertices: Float32Array): void {
    if (this.solved === null) {
      for (let j = 0; j < this.skeleton.bones.length; j++) {
        new THREE.Matrix4().toArray(this.skeleton.boneMatrices as Float32Array, 16 * j);
      }
      this.skeleton.upload();
    }
    this.solved = vertices;
    const { position, normal } = this.built.geometry.attributes;
    this.built.corners.writePositions(vertices, position.array as Float32Array);
    this.built.corners.writeNormals(vertices, normal.array as Float32Array);
    position.needsUpdate = normal.needsUpdate = true;
    this.mesh.visible = true;
  }

  /** Returns the box around the vertices as they are shown; empty before the first pose. */
  box(): THREE.Box3 {
    const vertices = this.solved ?? (this.newest && skinVertices(this.character, this.newest));
    return vertices === null ? new THREE.Box3() : new THREE.Box3().setFromArray(vertices);
  }

  /** Frees the memory on the GPU. */
  dispose(): void {
    this.mesh.removeFromParent();
    this.built.geometry.dispose();
    for (const material of [this.mesh.material].flat()) material.dispose();
    this.loader?.dispose();
    this.skeleton.dispose();
  }
}
