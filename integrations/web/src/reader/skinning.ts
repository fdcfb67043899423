/** Linear blend skinning on the CPU. The page does the same on the GPU; this is the reference and for exporters. */

import type { Character } from "./messages.js";
import type { Pose } from "./posecode.js";

/**
 * Writes 16 J entries to `out`, the matrices world_from_rest of a pose, column by column as WebGL expects.
 *
 * The translation of transform j is position_j - linear_j pivot_j.
 */
export function writeMatrices(pose: Pose, pivots: Float32Array, out: Float32Array): void {
  const { linear, positions } = pose;
  for (let j = 0; 3 * j < positions.length; j++) {
    for (let row = 0; row < 3; row++) {
      let offset = positions[3 * j + row];
      for (let column = 0; column < 3; column++) {
        const entry = linear[9 * j + 3 * row + column];
        out[16 * j + 4 * column + row] = entry;
        offset -= entry * pivots[3 * j + column];
      }
      out[16 * j + 12 + row] = offset;
    }
    out[16 * j + 3] = out[16 * j + 7] = out[16 * j + 11] = 0;
    out[16 * j + 15] = 1;
  }
}

/** Returns 3 V metres, world frame: v' = sum_k w_k (linear_k (v - pivot_k) + position_k) of every vertex. */
export function skinVertices(character: Character, pose: Pose): Float32Array {
  const { vertices, skinIndices, skinWeights, pivots } = character;
  const matrices = new Float32Array((16 * pivots.length) / 3);
  writeMatrices(pose, pivots, matrices);
  const out = new Float32Array(vertices.length);
  for (let vertex = 0; 3 * vertex < vertices.length; vertex++) {
    const [x, y, z] = vertices.subarray(3 * vertex, 3 * vertex + 3);
    for (let row = 0; row < 3; row++) {
      let sum = 0;
      for (let k = 4 * vertex; k < 4 * vertex + 4; k++) {
        const m = 16 * skinIndices[k] + row;
        sum += skinWeights[k] * (matrices[m] * x + matrices[m + 4] * y + matrices[m + 8] * z + matrices[m + 12]);
      }
      out[3 * vertex + row] = sum;
    }
  }
  return out;
}
