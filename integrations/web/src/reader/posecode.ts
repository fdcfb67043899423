/**
 * Decoder of poses. Every transform is predicted from its neighbour in a tree, and only small differences are
 * sent.
 *
 * The tree is the minimum spanning tree of the character's pivots. Both ends compute it from the same character.
 * The bytes of a pose are the CRC-32 of the tree (little-endian), and a table of integers with 12 columns, in the
 * order of the tree: 3 of position, 3 of a rotation vector, 6 of stretch. The table is coded as in rice.ts.
 */

import { crc32 } from "./crc32.js";
import { decodeColumns } from "./rice.js";

/** Columns of the table: 3 of position, 3 of the rotation vector, 6 of the stretch. */
const COLUMNS = 12;
/** Metres of a step of a position. */
const POSITION_STEP = 2 ** -12;
/** Radians of a step of a rotation vector. */
const ROTATION_STEP = 2 ** -10;
/** Step of an entry of the stretch, without unit. */
const STRETCH_STEP = 2 ** -9;
/** Square metres added to pairs of pivots without an edge, so that edges are preferred. */
const UNLINKED_PENALTY_M2 = 1e9;

/** The parts of a character that define how its poses are coded. */
export interface PoseLayout {
  /** "graph": a child is predicted by the mean of both linear parts. Otherwise by that of its parent. */
  kind: string;
  /** 3 J metres, the pivots of the transforms. */
  pivots: Float32Array;
  /** 2 E indices of neighbouring transforms. */
  edges: Int32Array;
}

/** The transforms of a character: a vertex v of transform j moves to linear_j (v - pivot_j) + position_j. */
export interface Pose {
  /** 9 J entries of 3 x 3 matrices, row by row. */
  linear: Float32Array;
  /** 3 J metres, world frame. */
  positions: Float32Array;
}

/** The joining order of a minimum spanning tree, and the parent of each transform by index, -1 at the root. */
export interface SpanningTree {
  order: Int32Array;
  parents: Int32Array;
}

/**
 * Returns the minimum spanning tree of the pivots by Prim's algorithm. The first transform is the root.
 *
 * Ties are resolved by the lower index. All sums are in the order of the encoder, in double precision, so that
 * both ends find the same tree.
 */
export function spanningTree(pivots: Float32Array, edges: Int32Array): SpanningTree {
  const count = pivots.length / 3;
  const neighbours: Set<number>[] = Array.from({ length: count }, () => new Set());
  for (let edge = 0; edge < edges.length; edge += 2) {
    neighbours[edges[edge]].add(edges[edge + 1]);
    neighbours[edges[edge + 1]].add(edges[edge]);
  }
  const cost = new Float64Array(count).fill(Infinity);
  const parents = new Int32Array(count).fill(-1);
  const isJoined = new Uint8Array(count);
  const order = new Int32Array(count);
  let node = 0;
  for (let step = 0; step < count; step++) {
    order[step] = node;
    isJoined[node] = 1;
    let nearest = -1;
    for (let other = 0; other < count; other++) {
      if (isJoined[other]) continue;
      const x = pivots[3 * other] - pivots[3 * node];
      const y = pivots[3 * other + 1] - pivots[3 * node + 1];
      const z = pivots[3 * other + 2] - pivots[3 * node + 2];
      const distance = x * x + y * y + z * z;
      const penalized = neighbours[node].has(other) ? distance : distance + UNLINKED_PENALTY_M2;
      if (penalized < cost[other]) {
        cost[other] = penalized;
        parents[other] = node;
      }
      if (nearest < 0 || cost[other] < cost[nearest]) nearest = other;
    }
    node = Math.max(nearest, 0);
  }
  return { order, parents };
}

/** Decodes the poses of one revision of a character. Create it once, and use it for every pose. */
export class PoseDecoder {
  private readonly tree: SpanningTree;
  private readonly isGraph: boolean;
  private readonly checksum: number;

  constructor(private readonly layout: PoseLayout) {
    this.tree = spanningTree(layout.pivots, layout.edges);
    this.isGraph = layout.kind === "graph";
    const parts = [layout.pivots, this.tree.order, this.tree.parents];
    const bytes = new Uint8Array(parts.reduce((sum, part) => sum + part.byteLength, 0));
    let at = 0;
    for (const part of parts) {
      bytes.set(new Uint8Array(part.buffer, part.byteOffset, part.byteLength), at);
      at += part.byteLength;
    }
    this.checksum = crc32(bytes);
  }

  /**
   * Returns the pose of some bytes.
   *
   * Throws a RangeError if the bytes belong to another revision of the character, or are damaged.
   */
  decode(data: Uint8Array): Pose {
    const check = data.length < 4 ? -1 : new DataView(data.buffer, data.byteOffset).getUint32(0, true);
    if (check !== this.checksum) throw new RangeError("the pose belongs to another revision of the character");
    const count = this.tree.order.length;
    return this.restore(decodeColumns(data.subarray(4), count, COLUMNS));
  }

  /** Returns the pose of a table of differences, in double precision until the end. */
  private restore(table: Int32Array): Pose {
    const { order, parents } = this.tree;
    const { pivots } = this.layout;
    const count = order.length;
    const linear = new Float64Array(9 * count);
    const positions = new Float64Array(3 * count);
    const quaternions = new Float64Array(4 * count);
    const stretches = new Int32Array(6 * count);
    for (let row = 0; row < count; row++) {
      const node = order[row];
      const parent = parents[node];
      const differences = table.subarray(COLUMNS * row, COLUMNS * (row + 1));
      restoreRotation(quaternions, node, parent, differences);
      for (let c = 0; c < 6; c++) {
        const inherited = parent >= 0 ? stretches[6 * parent + c] : 0;
        stretches[6 * node + c] = differences[6 + c] + inherited;
      }
      writeLinear(quaternions, stretches, node, linear);
      for (let a = 0; a < 3; a++) {
        let expected = parent < 0 ? pivots[3 * node + a] : positions[3 * parent + a];
        for (let b = 0; b < 3 && parent >= 0; b++) {
          let entry = linear[9 * parent + 3 * a + b];
          if (this.isGraph) entry = 0.5 * (entry + linear[9 * node + 3 * a + b]);
          expected += entry * (pivots[3 * node + b] - pivots[3 * parent + b]);
        }
        positions[3 * node + a] = expected + differences[a] * POSITION_STEP;
      }
    }
    return { linear: Float32Array.from(linear), positions: Float32Array.from(positions) };
  }
}

/** Writes the unit quaternion (w, x, y, z) of a node: that of its parent, times the rotation of its row. */
function restoreRotation(
  quaternions: Float64Array, node: number, parent: number, differences: Int32Array,
): void {
  const vx = differences[3] * ROTATION_STEP;
  const vy = differences[4] * ROTATION_STEP;
  const vz = differences[5] * ROTATION_STEP;
  const angle = Math.sqrt(vx * vx + vy * vy + vz * vz);
  const scale = angle > 1e-12 ? Math.sin(0.5 * angle) / angle : 0.5;
  const [w, x, y, z] = [Math.cos(0.5 * angle), scale * vx, scale * vy, scale * vz];
  const [a, b, c, d] = parent >= 0 ? quaternions.subarray(4 * parent, 4 * parent + 4) : [1, 0, 0, 0];
  const q0 = a * w - b * x - c * y - d * z;
  const q1 = a * x + b * w + c * z - d * y;
  const q2 = a * y - b * z + c * w + d * x;
  const q3 = a * z + b * y - c * x + d * w;
  const unit = (q0 >= 0 ? 1 : -1) / Math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3);
  quaternions.set([unit * q0, unit * q1, unit * q2, unit * q3], 4 * node);
}

/** Writes the linear part of a node: its rotation matrix times the symmetric matrix of its stretch. */
function writeLinear(
  quaternions: Float64Array, stretches: Int32Array, node: number, linear: Float64Array,
): void {
  const [w, x, y, z] = quaternions.subarray(4 * node, 4 * node + 4);
  const rotation = [
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
  ];
  const s = Array.from(stretches.subarray(6 * node, 6 * node + 6), (steps) => steps * STRETCH_STEP);
  for (let m = 0; m < 3; m++) {
    const [r0, r1, r2] = rotation.slice(3 * m, 3 * m + 3);
    linear[9 * node + 3 * m] = r0 * (1 + s[0]) + r1 * s[3] + r2 * s[4];
    linear[9 * node + 3 * m + 1] = r0 * s[3] + r1 * (1 + s[1]) + r2 * s[5];
    linear[9 * node + 3 * m + 2] = r0 * s[4] + r1 * s[5] + r2 * (1 + s[2]);
  }
}
