"""Writes integrations/web/test/vectors.json: messages of the wire, and the numbers that a reader must decode.

    .venv/bin/python scripts/web_vectors.py     # after a change of the wire

Readers in other languages can use the same file. Each case contains the bytes in base64 and the decoded
content.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from enliven.arrays import Float, Float32
from enliven.deformation.skinning import skin_vertices
from enliven.document import BALL, BOX, Character, Pose, Props, SkinWeights
from enliven.person import Body
from enliven.rotation import from_rotation_vector, to_matrix
from enliven.wire import (
    PoseCodec,
    bodies_to_message,
    character_to_message,
    cues_to_message,
    message_to_bodies,
    message_to_character,
    message_to_pose,
    message_to_props,
    pack_payload,
    pack_stream,
    pose_to_message,
    props_to_message,
)

PATH = Path(__file__).parents[1] / "integrations" / "web" / "test" / "vectors.json"
KINDS = ("graph", "bones", "points")


def make_vectors() -> dict[str, Any]:
    """Returns all cases. The random numbers are the same in every run."""
    rng = np.random.default_rng(7)
    nodes, strengths = np.array([3, 300]), np.array([1.0, 0.2])
    return {
        "characters": [make_character_case(kind, rng) for kind in KINDS],
        "bodies": make_bodies_case(rng),
        "props": make_props_case(rng),
        "cues": [
            base64.b64encode(
                pack_stream(cues_to_message("chair", "possessed", nodes, strengths, 4, 9, owners))
            ).decode()
            for owners in (None, np.array([4, 11]))
        ],
    }


def make_character(kind: str, rng: np.random.Generator) -> Character:
    """Returns a character with random vertices, and with edges except for control points."""
    transforms, vertices = 24, 60
    pivots = rng.uniform(-1.0, 1.0, (transforms, 3)).astype(np.float32)
    weights = rng.uniform(0.1, 1.0, (vertices, 4)).astype(np.float32)
    weights /= weights.sum(1, keepdims=True)
    skin = SkinWeights(rng.integers(0, transforms, (vertices, 4)).astype(np.uint16), weights)
    edges = np.stack([np.arange(transforms - 1), np.arange(1, transforms)], 1).astype(np.int32)
    return Character(
        f"a {kind}",
        rng.uniform(-1.0, 1.0, (vertices, 3)).astype(np.float32),
        rng.integers(0, vertices, (40, 3)).astype(np.int32),
        skin,
        pivots,
        edges[:0] if kind == "points" else edges,
        kind,
        rng.integers(0, 256, (vertices, 3)).astype(np.uint8),
        held=np.arange(transforms - 1, dtype=np.int32) if kind == "points" else None,
    )


def make_poses(character: Character, rng: np.random.Generator) -> Iterator[Pose]:
    """Yields the rest pose, a usual pose, and one with large rotations, stretches and reflections."""
    count = len(character.pivots)
    yield character.rest_pose(1)
    for number, size in enumerate((0.3, 3.0)):
        turns = to_matrix(from_rotation_vector(rng.normal(0, size, (count, 3))))
        stretch = np.eye(3) + 0.1 * size * rng.normal(0, 1, (count, 3, 3))
        linear = (turns @ stretch).astype(np.float32)
        if number:
            linear[3] = 0.0
            linear[5] *= -40.0
        positions = (character.pivots + rng.normal(0, size, (count, 3))).astype(np.float32)
        yield Pose(character.id, 10**18 + number, linear, positions)


def make_character_case(kind: str, rng: np.random.Generator) -> dict[str, Any]:
    """Returns a character, and its poses with their transforms and skinned vertices."""
    character = make_character(kind, rng)
    payload = pack_payload(character_to_message(character, 5))
    codec = PoseCodec(character)
    poses = []
    for number, pose in enumerate(make_poses(character, rng)):
        message = pose_to_message(pose, codec, revision=5, instance=77, sequence=number, captured_ns=10**18)
        decoded = message_to_pose(message, codec)
        poses.append(
            {
                "data": base64.b64encode(pack_stream(message)).decode(),
                "linear": _list_numbers(decoded.linear),
                "positions": _list_numbers(decoded.positions),
                "skinned": _list_numbers(skin_vertices(character, decoded)),
            }
        )
    return {"kind": kind, "payload": base64.b64encode(payload).decode(), "poses": poses}


def make_bodies_case(rng: np.random.Generator) -> dict[str, Any]:
    """Returns a message of two tracked people, and their joints."""
    bodies = [Body(id, rng.uniform(-2, 2, (20, 3)), rng.uniform(0, 1, 20)) for id in (3, 12)]
    message = bodies_to_message(bodies, 5, 6)
    return {
        "data": base64.b64encode(pack_stream(message)).decode(),
        "joints": [_list_numbers(body.joints) for body in message_to_bodies(message)],
        "confidence": [_list_numbers(body.confidence) for body in message_to_bodies(message)],
    }


def make_props_case(rng: np.random.Generator) -> dict[str, Any]:
    """Returns a message of a box and a ball, and their positions and rotations."""
    turns = rng.normal(0, 1, (2, 4))
    props = Props(
        *(
            5,
            np.array([3, 9]),
            np.array([BOX, BALL], np.uint8),
            rng.uniform(0.1, 1, (2, 3)).astype(np.float32),
        ),
        *(rng.integers(0, 256, (2, 3)).astype(np.uint8), rng.uniform(-2, 2, (2, 3))),
        turns / np.linalg.norm(turns, axis=1, keepdims=True),
    )
    message = props_to_message(props)
    decoded = message_to_props(message)
    return {
        "data": base64.b64encode(pack_stream(message)).decode(),
        "positions": _list_numbers(decoded.positions),
        "turns": _list_numbers(decoded.turns),
        "sizes": _list_numbers(decoded.sizes),
    }


def read_vector_poses(case: dict[str, Any]) -> tuple[Character, list[bytes]]:
    """Returns the character of a case, and the bytes of its poses."""
    import msgspec

    from enliven.wire import CharacterMessage

    message = msgspec.msgpack.decode(base64.b64decode(case["payload"]), type=CharacterMessage)
    return message_to_character(message), [base64.b64decode(pose["data"]) for pose in case["poses"]]


def _list_numbers(array: Float | Float32) -> list[float]:
    """Returns all numbers in order, rounded to float32 and to seven significant digits."""
    return [float(f"{value:.7g}") for value in np.asarray(array, np.float32).reshape(-1)]


if __name__ == "__main__":
    PATH.write_text(json.dumps(make_vectors()) + "\n")
