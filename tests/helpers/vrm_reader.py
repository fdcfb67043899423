"""Reads VRM files without enliven: the human bones, and the world matrices of their nodes at a keyframe."""

from __future__ import annotations

import json
import struct

import numpy as np


def chunks(data: bytes) -> tuple[dict, bytes]:
    """Returns the JSON and the binary chunk of a GLB."""
    (length,) = struct.unpack_from("<I", data, 12)
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def human_nodes(document: dict, extension: str) -> dict[str, int]:
    """Returns the node of each human bone."""
    bones = document["extensions"][extension]["humanoid"]["humanBones"]
    return {name: bone["node"] for name, bone in bones.items()}


def world_matrices(data: bytes, key: int | None = None) -> np.ndarray:
    """Returns (N, 4, 4) world matrices of all nodes, at rest or at a key of the animation.

    All channels must have the same keys, or two equal ones.
    """
    document, binary = chunks(data)
    local = [
        (node.get("translation", [0, 0, 0]), node.get("rotation", [0, 0, 0, 1])) for node in document["nodes"]
    ]
    if key is not None:
        (animation,) = document["animations"]
        for channel in animation["channels"]:
            values = _accessor(document, binary, animation["samplers"][channel["sampler"]]["output"])
            value = values[min(key, len(values) - 1)]
            node, path = channel["target"]["node"], channel["target"]["path"]
            place, turn = local[node]
            local[node] = (value, turn) if path == "translation" else (place, value)
    world = np.tile(np.eye(4), (len(local), 1, 1))
    parents = {
        child: number for number, node in enumerate(document["nodes"]) for child in node.get("children", [])
    }
    for number, (place, turn) in enumerate(local):
        world[number, :3, :3], world[number, :3, 3] = _matrix(turn), place
        if number in parents:
            assert parents[number] < number
            world[number] = world[parents[number]] @ world[number]
    return world


def _accessor(document: dict, binary: bytes, number: int) -> np.ndarray:
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    width = {"VEC3": 3, "VEC4": 4, "SCALAR": 1}[accessor["type"]]
    assert accessor["componentType"] == 5126
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    return np.frombuffer(binary, np.float32, accessor["count"] * width, start).reshape(-1, width)


def _matrix(turn: np.ndarray) -> np.ndarray:
    x, y, z, w = turn
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
