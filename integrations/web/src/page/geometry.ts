/** Geometry of a character: one vertex for each corner of a face, because materials and creases differ by corner. */

import * as THREE from "three";

import type { Character } from "../reader/index.js";

/** Two faces that meet at a larger angle have a visible edge: boards look flat, and seats round. */
const CREASE_COSINE = Math.cos(Math.PI / 4);
/** sRGB of a mesh without colours: warm, in contrast to the cold stage. */
const DEFAULT_COLOUR = [226, 142, 84];

/** The corners of a mesh, and the faces whose normals each corner averages. */
export class Corners {
  /** The vertex of each corner. */
  readonly source: Uint32Array;
  private readonly starts: Uint32Array;
  private readonly faces: Uint32Array;

  /**
   * @param order the faces in drawing order.
   */
  constructor(vertices: Float32Array, faces: Int32Array, order: Uint32Array) {
    this.source = Uint32Array.from({ length: 3 * order.length }, (_, at) => faces[3 * order[(at / 3) | 0] + (at % 3)]);
    const normals = this.faceNormals(vertices);
    const facesAt = groupByPlace(vertices, this.source);
    const starts = [0];
    const grouped: number[] = [];
    for (let corner = 0; corner < this.source.length; corner++) {
      const own = 3 * ((corner / 3) | 0);
      for (const face of facesAt[corner]) {
        if (cosine(normals, own, 3 * face) >= CREASE_COSINE) grouped.push(face);
      }
      starts.push(grouped.length);
    }
    this.starts = Uint32Array.from(starts);
    this.faces = Uint32Array.from(grouped);
  }

  /** Writes the position of each corner. */
  writePositions(vertices: Float32Array, out: Float32Array): void {
    for (let corner = 0; corner < this.source.length; corner++) {
      const vertex = 3 * this.source[corner];
      out[3 * corner] = vertices[vertex];
      out[3 * corner + 1] = vertices[vertex + 1];
      out[3 * corner + 2] = vertices[vertex + 2];
    }
  }

  /** Writes the unit normal of each corner: that of its faces, weighted by their areas. */
  writeNormals(vertices: Float32Array, out: Float32Array): void {
    const normals = this.faceNormals(vertices);
    for (let corner = 0; corner < this.source.length; corner++) {
      let [x, y, z] = [0, 0, 0];
      for (let at = this.starts[corner]; at < this.starts[corner + 1]; at++) {
        const face = 3 * this.faces[at];
        x += normals[face];
        y += normals[face + 1];
        z += normals[face + 2];
      }
      const length = Math.hypot(x, y, z) || 1;
      out[3 * corner] = x / length;
      out[3 * corner + 1] = y / length;
      out[3 * corner + 2] = z / length;
    }
  }

  /** Returns the normals of the faces in drawing order, with twice the area as length. */
  private faceNormals(v: Float32Array): Float32Array {
    const normals = new Float32Array(this.source.length);
    for (let at = 0; at < this.source.length; at += 3) {
      const [a, b, c] = [3 * this.source[at], 3 * this.source[at + 1], 3 * this.source[at + 2]];
      const [px, py, pz] = [v[b] - v[a], v[b + 1] - v[a + 1], v[b + 2] - v[a + 2]];
      const [qx, qy, qz] = [v[c] - v[a], v[c + 1] - v[a + 1], v[c + 2] - v[a + 2]];
      normals[at] = py * qz - pz * qy;
      normals[at + 1] = pz * qx - px * qz;
      normals[at + 2] = px * qy - py * qx;
    }
    return normals;
  }
}

/** Returns for each corner the faces at its place. Vertices of a file that coincide count as one. */
function groupByPlace(vertices: Float32Array, source: Uint32Array): number[][] {
  const places = new Map<string, number[]>();
  const byVertex = new Map<number, number[]>();
  return Array.from(source, (vertex, corner) => {
    let faces = byVertex.get(vertex);
    if (faces === undefined) {
      const key = vertices.subarray(3 * vertex, 3 * vertex + 3).join(" ");
      faces = places.get(key) ?? [];
      places.set(key, faces);
      byVertex.set(vertex, faces);
    }
    const face = (corner / 3) | 0;
    if (faces[faces.length - 1] !== face) faces.push(face);
    return faces;
  });
}

function cosine(normals: Float32Array, a: number, b: number): number {
  const dot = normals[a] * normals[b] + normals[a + 1] * normals[b + 1] + normals[a + 2] * normals[b + 2];
  const lengths =
    Math.hypot(normals[a], normals[a + 1], normals[a + 2]) * Math.hypot(normals[b], normals[b + 1], normals[b + 2]);
  return a === b ? 1 : lengths > 0 ? dot / lengths : -1;
}

/** A character's geometry, and the material of each of its groups, -1 for none. */
export interface CharacterGeometry {
  geometry: THREE.BufferGeometry;
  corners: Corners;
  materials: number[];
}

/** Returns the geometry of a character at rest. Its groups have the indices of `materials`. */
export function buildGeometry(character: Character): CharacterGeometry {
  const { vertices, faces, skinIndices, skinWeights, materials } = character;
  const count = faces.length / 3;
  const of = materials === null ? new Int32Array(count).fill(-1) : materials.of;
  const order = Uint32Array.from({ length: count }, (_, face) => face).sort((a, b) => of[a] - of[b] || a - b);
  const corners = new Corners(vertices, faces, order);
  const geometry = new THREE.BufferGeometry();
  const length = 3 * count;
  const [positions, normals] = [new Float32Array(3 * length), new Float32Array(3 * length)];
  corners.writePositions(vertices, positions);
  corners.writeNormals(vertices, normals);
  const [indices, weights] = [new Uint16Array(4 * length), new Float32Array(4 * length)];
  corners.source.forEach((vertex, corner) => {
    indices.set(skinIndices.subarray(4 * vertex, 4 * vertex + 4), 4 * corner);
    weights.set(skinWeights.subarray(4 * vertex, 4 * vertex + 4), 4 * corner);
  });
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
  geometry.setAttribute("skinIndex", new THREE.BufferAttribute(indices, 4));
  geometry.setAttribute("skinWeight", new THREE.BufferAttribute(weights, 4));
  geometry.setAttribute("color", new THREE.BufferAttribute(cornerColours(character, corners, order, of), 4));
  for (let set = 0; materials !== null && set < materials.sets; set++) {
    const uvs = new Float32Array(2 * length);
    order.forEach((face, at) => {
      for (let corner = 0; corner < 3; corner++) {
        const start = 2 * ((3 * face + corner) * materials.sets + set);
        uvs.set(materials.uvs.subarray(start, start + 2), 2 * (3 * at + corner));
      }
    });
    geometry.setAttribute(set ? `uv${set}` : "uv", new THREE.BufferAttribute(uvs, 2));
  }
  return { geometry, corners, materials: addGroups(geometry, order, of) };
}

/** Adds a group for each material in use, and returns the materials. */
function addGroups(geometry: THREE.BufferGeometry, order: Uint32Array, of: Int32Array): number[] {
  const used: number[] = [];
  let start = 0;
  for (let at = 1; at <= order.length; at++) {
    if (at < order.length && of[order[at]] === of[order[start]]) continue;
    geometry.addGroup(3 * start, 3 * (at - start), used.length);
    used.push(of[order[start]]);
    start = at;
  }
  return used;
}

/** Returns linear colours with opacity: those of the vertices, or the tints of faces with a material. */
function cornerColours(
  character: Character, corners: Corners, order: Uint32Array, of: Int32Array,
): Float32Array {
  const { colours, materials } = character;
  const linear = Float32Array.from({ length: 256 }, (_, byte) => new THREE.Color().setRGB(
    byte / 255, 0, 0, THREE.SRGBColorSpace).r);
  const out = new Float32Array(4 * corners.source.length).fill(1);
  corners.source.forEach((vertex, corner) => {
    const face = order[(corner / 3) | 0];
    if (of[face] < 0) {
      for (let c = 0; c < 3; c++) out[4 * corner + c] = linear[colours ? colours[3 * vertex + c] : DEFAULT_COLOUR[c]];
    } else if (materials?.tints) {
      const start = 4 * (3 * face + (corner % 3));
      out.set(materials.tints.subarray(start, start + 4), 4 * corner);
    }
  });
  return out;
}
