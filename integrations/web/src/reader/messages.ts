/**
 * Messages of the wire: bytes of a stream message to an object with typed arrays.
 *
 * A stream message is the name of its topic, a zero byte, the version, and an array in MessagePack. A newer sender
 * may append fields, which are ignored. Numbers in byte strings are little-endian, as on every machine that runs
 * browsers. Nanoseconds become JavaScript numbers, which round them to 256 ns.
 */

import { decode } from "@msgpack/msgpack";

import { PoseDecoder } from "./posecode.js";
import { unpackQuaternions } from "./quaternions.js";

/** Version of the wire that this reader understands. */
export const VERSION = 1;
/** Metres of a step of a joint or a prop. */
const JOINT_STEP = 2 ** -11;
/** Joints of a tracked body. */
export const JOINT_COUNT = 20;
/** Parent of each joint of a tracked body, -1 at the hip centre. */
export const JOINT_PARENTS = [-1, 0, 1, 2, 2, 4, 5, 6, 2, 8, 9, 10, 0, 12, 13, 14, 0, 16, 17, 18];

/** The coded transforms of one character at one moment. Decode them with the character of the same revision. */
export interface PoseMessage {
  character: string;
  revision: number;
  /** Random number of the edge's process. */
  instance: number;
  /** Counts the poses of the character from 0. A gap is a loss. */
  sequence: number;
  /** Time of the sensor in nanoseconds. */
  timeNs: number;
  /** Wall clock of the edge when the frame was read, and when the pose was sent. */
  capturedNs: number;
  publishedNs: number;
  transforms: Uint8Array;
}

/** A tracked person. */
export interface Body {
  id: number;
  /** 3 x 20 metres, world frame. */
  joints: Float32Array;
  /** 20 numbers in 0..1. */
  confidence: Float32Array;
}

export interface BodiesMessage {
  timeNs: number;
  capturedNs: number;
  bodies: Body[];
}

/** The nodes that performers hold of a character. */
export interface CuesMessage {
  character: string;
  state: "free" | "preview" | "possessed";
  nodes: Uint16Array;
  /** Numbers in 0..1, one for each node. */
  strengths: Float32Array;
  /** Ids of the performers that hold nodes. */
  performers: number[];
}

export interface PropsMessage {
  timeNs: number;
  ids: Uint16Array;
  /** 0 a box, 1 a ball. */
  shapes: Uint8Array;
  /** 3 P metres: half edges of a box, or the radius of a ball three times. */
  sizes: Float32Array;
  /** 3 P bytes, sRGB. */
  colours: Uint8Array;
  /** 3 P metres. */
  positions: Float32Array;
  /** 4 P numbers: unit quaternions w, x, y, z. */
  turns: Float32Array;
}

export interface StageMessage {
  timeNs: number;
  characters: { character: string; revision: number }[];
}

/** The heartbeat of the edge, twice per second. */
export interface StatusMessage {
  edge: string;
  instance: number;
  revision: number;
  publishedNs: number;
  sensor: string;
  phase: string;
  note: string;
  fps: number;
  performers: number;
}

export interface TextureMessage {
  /** A PNG or JPEG file. */
  image: Uint8Array;
  /** JSON of a glTF sampler, or empty. */
  sampler: string;
}

export interface Materials {
  /** JSON objects of glTF materials. They refer to textures by their number in `textures`. */
  definitions: string[];
  textures: TextureMessage[];
  /** The material of each face, -1 for none. */
  of: Int32Array;
  /** Sets of texture coordinates. */
  sets: number;
  /** F x 3 x sets x 2 texture coordinates. */
  uvs: Float32Array;
  /** F x 3 x 4 linear colours and opacities, or null for white. */
  tints: Float32Array | null;
}

/** A whole character at rest. */
export interface Character {
  id: string;
  revision: number;
  /** "graph", "bones", or "points" for a mesh that control points drive. */
  kind: string;
  vertices: Float32Array;
  faces: Int32Array;
  /** 4 V indices and weights: the transforms that each vertex follows. */
  skinIndices: Uint16Array;
  skinWeights: Float32Array;
  pivots: Float32Array;
  edges: Int32Array;
  /** 3 V bytes sRGB, or null. */
  colours: Uint8Array | null;
  names: string[] | null;
  materials: Materials | null;
  decoder: PoseDecoder;
}

export type StreamMessage =
  | { topic: "pose"; value: PoseMessage }
  | { topic: "bodies"; value: BodiesMessage }
  | { topic: "cues"; value: CuesMessage }
  | { topic: "props"; value: PropsMessage }
  | { topic: "stage"; value: StageMessage }
  | { topic: "status"; value: StatusMessage }
  | { topic: "other"; name: string };

/** A message of another version of the wire. */
export class OtherVersionError extends Error {
  constructor(readonly version: number) {
    super(`the edge speaks version ${version} of the wire, this page version ${VERSION}`);
  }
}

/** Splits the bytes of a stream message into the name of its topic and its payload in MessagePack. */
export function splitStream(data: Uint8Array): { topic: string; payload: Uint8Array } {
  const end = data.subarray(0, 64).indexOf(0);
  if (end < 0 || data.length < end + 2) throw new RangeError("a stream message has no topic");
  if (data[end + 1] !== VERSION) throw new OtherVersionError(data[end + 1]);
  return { topic: String.fromCharCode(...data.subarray(0, end)), payload: data.subarray(end + 2) };
}

/** Returns the message of the bytes that the stream socket delivers. Throws for bytes that are not a message. */
export function readStream(data: Uint8Array): StreamMessage {
  const { topic, payload } = splitStream(data);
  const read = READERS[topic as keyof typeof READERS];
  if (read === undefined) return { topic: "other", name: topic };
  const fields = decode(payload);
  if (!Array.isArray(fields)) throw new RangeError(`the message ${topic} is not an array`);
  return { topic, value: read(fields) } as StreamMessage;
}

// The fields of each message in their order, see docs/wire.md.
const READERS = {
  pose: (f: any[]): PoseMessage => ({
    character: f[0], revision: f[1], instance: f[2], sequence: f[3], timeNs: f[4], capturedNs: f[5],
    publishedNs: f[6], transforms: f[7],
  }),
  bodies: (f: any[]): BodiesMessage => ({ timeNs: f[0], capturedNs: f[1], bodies: f[2].map(readBody) }),
  cues: (f: any[]): CuesMessage => ({
    character: f[0], state: f[1], nodes: uint16(f[2]), strengths: fractions(f[3]),
    performers: f[7]?.length ? f[7] : f[4] >= 0 ? [f[4]] : [],
  }),
  props: (f: any[]): PropsMessage => ({
    timeNs: f[0], ids: uint16(f[1]), shapes: f[2], sizes: Float32Array.from(uint16(f[3]), (mm) => mm / 1000),
    colours: f[4], positions: metres(f[5]), turns: unpackQuaternions(f[6]),
  }),
  stage: (f: any[]): StageMessage => ({
    timeNs: f[0], characters: f[1].map(([character, revision]: [string, number]) => ({ character, revision })),
  }),
  status: (f: any[]): StatusMessage => ({
    edge: f[0], instance: f[1], revision: f[2], publishedNs: f[3], sensor: f[4] ?? "", phase: f[5] ?? "waiting",
    note: f[6] ?? "", fps: f[7] ?? 0, performers: f[10] ?? 0,
  }),
};

function readBody([id, joints, confidence]: any[]): Body {
  return { id, joints: metres(joints), confidence: fractions(confidence) };
}

/** Returns the character of a payload in MessagePack, the map that an edge sends as the body of its reply. */
export function readCharacter(payload: Uint8Array): Character {
  const map = decode(payload) as any;
  const kind: string = map.held == null ? map.kind : "points";
  const vertices = float32(map.vertices);
  const pivots = float32(map.pivots);
  const edges = int32(map.edges);
  const count = vertices.length / 3;
  const isRigid = map.indices.length === 0;
  const weights = isRigid ? new Float32Array(4 * count) : float32(map.weights);
  if (isRigid) for (let vertex = 0; vertex < count; vertex++) weights[4 * vertex] = 1;
  return {
    id: map.id, revision: map.revision, kind, vertices, pivots, edges,
    faces: int32(map.faces),
    skinIndices: isRigid ? new Uint16Array(4 * count) : uint16(map.indices),
    skinWeights: weights,
    colours: map.colours ?? null,
    names: map.names ?? null,
    materials: map.materials == null ? null : readMaterials(map.materials),
    decoder: new PoseDecoder({ kind, pivots, edges }),
  };
}

function readMaterials(map: any): Materials {
  return {
    definitions: map.definitions,
    textures: map.textures.map(({ image, sampler }: any) => ({ image, sampler: sampler ?? "" })),
    of: int32(map.of), sets: map.sets, uvs: float32(map.uvs),
    tints: map.tints == null ? null : float32(map.tints),
  };
}

// Byte strings of a message start at any byte, so they are copied to where typed arrays may start.
const float32 = (data: Uint8Array): Float32Array => new Float32Array(data.slice().buffer);
const int32 = (data: Uint8Array): Int32Array => new Int32Array(data.slice().buffer);
const uint16 = (data: Uint8Array): Uint16Array => new Uint16Array(data.slice().buffer);
const metres = (data: Uint8Array): Float32Array =>
  Float32Array.from(new Int16Array(data.slice().buffer), (steps) => steps * JOINT_STEP);
const fractions = (data: Uint8Array): Float32Array => Float32Array.from(data, (byte) => byte / 255);
