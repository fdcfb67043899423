// Compares the reader with the numbers of the Python reader: node --test test/*.test.mjs
// scripts/web_vectors.py writes vectors.json.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { decodeColumns, OtherVersionError, readCharacter, readStream, skinVertices } from "../lib/reader.js";

const vectors = JSON.parse(readFileSync(new URL("vectors.json", import.meta.url), "utf8"));
const bytes = (text) => new Uint8Array(Buffer.from(text, "base64"));

// The vectors have seven significant digits. Sine and square root of both languages differ by one unit in the last
// of 16 digits, which the sums along the tree of 24 transforms keep far below this.
const TOLERANCE = 2e-6;
// Skinned vertices are sums of 12 products in float32 in Python, and in double precision here.
const SKIN_TOLERANCE = 1e-5;

function assertClose(actual, expected, tolerance, name) {
  assert.equal(actual.length, expected.length, `${name}: length`);
  for (let at = 0; at < expected.length; at++) {
    const limit = tolerance * Math.max(1, Math.abs(expected[at]));
    assert.ok(Math.abs(actual[at] - expected[at]) <= limit, `${name}[${at}]: ${actual[at]}, not ${expected[at]}`);
  }
}

for (const { kind, payload, poses } of vectors.characters) {
  test(`poses of a character of kind ${kind} are those of Python`, () => {
    const character = readCharacter(bytes(payload));
    assert.equal(character.kind, kind);
    assert.equal(character.revision, 5);
    poses.forEach(({ data, linear, positions, skinned }, number) => {
      const { topic, value } = readStream(bytes(data));
      assert.equal(topic, "pose");
      assert.deepEqual([value.character, value.revision, value.sequence], [`a ${kind}`, 5, number]);
      const pose = character.decoder.decode(value.transforms);
      assertClose(pose.linear, linear, TOLERANCE, "linear");
      assertClose(pose.positions, positions, TOLERANCE, "positions");
      assertClose(skinVertices(character, pose), skinned, SKIN_TOLERANCE, "skinned");
    });
  });
}

test("a damaged or truncated pose is refused", () => {
  const { payload, poses } = vectors.characters[0];
  const character = readCharacter(bytes(payload));
  const { transforms } = readStream(bytes(poses[1].data)).value;
  const extended = new Uint8Array(transforms.length + 1);
  extended.set(transforms);
  for (const wrong of [transforms.subarray(0, 3), transforms.subarray(0, transforms.length - 1), extended]) {
    assert.throws(() => character.decoder.decode(wrong), RangeError);
  }
});

test("a pose of another character is refused", () => {
  const [graph, bones] = vectors.characters;
  const { transforms } = readStream(bytes(bones.poses[0].data)).value;
  assert.throws(() => readCharacter(bytes(graph.payload)).decoder.decode(transforms), /another revision/);
});

test("bodies are those of Python", () => {
  const { topic, value } = readStream(bytes(vectors.bodies.data));
  assert.equal(topic, "bodies");
  assert.deepEqual(value.bodies.map((body) => body.id), [3, 12]);
  value.bodies.forEach((body, number) => {
    assertClose(body.joints, vectors.bodies.joints[number], TOLERANCE, "joints");
    assertClose(body.confidence, vectors.bodies.confidence[number], TOLERANCE, "confidence");
  });
});

test("props are those of Python", () => {
  const { value } = readStream(bytes(vectors.props.data));
  assert.deepEqual([[...value.ids], [...value.shapes]], [[3, 9], [0, 1]]);
  assertClose(value.positions, vectors.props.positions, TOLERANCE, "positions");
  assertClose(value.sizes, vectors.props.sizes, TOLERANCE, "sizes");
  assertClose(value.turns, vectors.props.turns, TOLERANCE, "turns");
});

test("cues name the nodes and the performers", () => {
  [[4], [4, 11]].forEach((performers, number) => {
    const { value } = readStream(bytes(vectors.cues[number]));
    assert.deepEqual([value.state, [...value.nodes], value.performers], ["possessed", [3, 300], performers]);
  });
});

test("messages of another version and without a topic are refused", () => {
  const data = bytes(vectors.cues[0]);
  data[data.indexOf(0) + 1] = 2;
  assert.throws(() => readStream(data), OtherVersionError);
  assert.throws(() => readStream(new Uint8Array(80).fill(65)), /no topic/);
});

test("an unknown topic is reported, not refused", () => {
  const data = new TextEncoder().encode("news\0\x01\x90");
  assert.deepEqual(readStream(data), { topic: "other", name: "news" });
});

test("raw numbers of Rice codes are read", () => {
  // Column of one number: parameter 0, twelve ones, then u = 5 in 22 bits, which is -3.
  const bits = "0000" + "1".repeat(12) + (5).toString(2).padStart(22, "0");
  const data = Uint8Array.from(bits.padEnd(40, "0").match(/.{8}/g), (byte) => parseInt(byte, 2));
  assert.deepEqual([...decodeColumns(data, 1, 1)], [-3]);
});
