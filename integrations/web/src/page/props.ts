/** Loose objects of the edge's physics: boxes and balls. */

import * as THREE from "three";

import type { PropsMessage } from "../reader/index.js";

const BOX = new THREE.BoxGeometry(2, 2, 2);
const BALL = new THREE.SphereGeometry(1, 28, 18);

/** All props at one moment. Add `group` to a scene. */
export class Props {
  readonly group = new THREE.Group();
  private readonly meshes = new Map<number, THREE.Mesh>();

  /** Shows these props, and removes all others. */
  show(message: PropsMessage): void {
    const ids = new Set(message.ids);
    for (const [id, mesh] of this.meshes) {
      if (ids.has(id)) continue;
      mesh.removeFromParent();
      (mesh.material as THREE.Material).dispose();
      this.meshes.delete(id);
    }
    message.ids.forEach((id, at) => {
      const mesh = this.meshes.get(id) ?? this.create(id, message.shapes[at]);
      const [r, g, b] = message.colours.subarray(3 * at, 3 * at + 3);
      const [w, x, y, z] = message.turns.subarray(4 * at, 4 * at + 4);
      (mesh.material as THREE.MeshStandardMaterial).color.setRGB(r / 255, g / 255, b / 255, THREE.SRGBColorSpace);
      mesh.position.fromArray(message.positions, 3 * at);
      mesh.scale.fromArray(message.sizes, 3 * at);
      mesh.quaternion.set(x, y, z, w);
    });
  }

  private create(id: number, shape: number): THREE.Mesh {
    const mesh = new THREE.Mesh(shape === 0 ? BOX : BALL, new THREE.MeshStandardMaterial({ roughness: 0.6 }));
    mesh.castShadow = mesh.receiveShadow = true;
    this.meshes.set(id, mesh);
    this.group.add(mesh);
    return mesh;
  }
}
