"""Generated glTF files with one unusual feature each, like those in files that other programs write.

Each is a tower of square rings, 1.6 m tall, on its own or on a chain of two joints.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
from gltf_builder import GltfBuilder

HALF = [0.0, 0.0, float(np.sin(0.4)), float(np.cos(0.4))]
"""A rotation of 0.8 radians about z, as (x, y, z, w)."""


class Twin(GltfBuilder):
    """A GLB under construction."""

    def accessor(self, array: np.ndarray, **entries) -> int:
        """Adds an accessor with more entries, such as "normalized"."""
        number = super().accessor(array)
        self.json["accessors"][number] |= entries
        return number

    def node(self, parent: int | None = None, in_scene: bool = True, **entries) -> int:
        self.json["nodes"].append(entries)
        number = len(self.json["nodes"]) - 1
        if parent is not None:
            self.json["nodes"][parent].setdefault("children", []).append(number)
        elif in_scene:
            self.json["scenes"][0]["nodes"].append(number)
        return number

    def add(self, kind: str, entry: dict) -> int:
        self.json.setdefault(kind, []).append(entry)
        return len(self.json[kind]) - 1

    def channel(self, animation: int, target: dict, times, values, how: str = "LINEAR") -> None:
        animations = self.json.setdefault("animations", [])
        while len(animations) <= animation:
            animations.append({"name": f"clip {len(animations)}", "channels": [], "samplers": []})
        entry = {"input": self.accessor(np.array(times, "f4")), "interpolation": how}
        entry["output"] = self.accessor(np.array(values, "f4"))
        animations[animation]["samplers"].append(entry)
        channel = {"sampler": len(animations[animation]["samplers"]) - 1, "target": target}
        animations[animation]["channels"].append(channel)

    def extension(self, name: str, required: bool = False) -> None:
        self.json.setdefault("extensionsUsed", []).append(name)
        if required:
            self.json.setdefault("extensionsRequired", []).append(name)

    def glb(self) -> bytes:
        self.json["buffers"] = [{"byteLength": len(self.blob)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        blob = self.blob + b"\0" * (-len(self.blob) % 4)
        parts = (
            struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
        )
        return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts

    def write(self, path: Path) -> Path:
        path.write_bytes(self.glb())
        return path


def tower(rings: int = 9, height: float = 1.6) -> tuple[np.ndarray, np.ndarray]:
    """Returns (V, 3) float32 and (F, 3) uint16: square rings above one another, closed at both ends."""
    square = np.array([[1, 0, 1], [-1, 0, 1], [-1, 0, -1], [1, 0, -1]]) * 0.1
    levels = [square + np.array([0, y, 0]) for y in np.linspace(0, height, rings)]
    faces = []
    for k in range(rings - 1):
        for a in range(4):
            b = (a + 1) % 4
            low, up = 4 * k, 4 * k + 4
            faces += [[low + b, low + a, up + a], [low + b, up + a, up + b]]
    faces += [[0, 1, 2], [0, 2, 3]]
    top = 4 * rings - 4
    faces += [[top + 2, top + 1, top], [top + 3, top + 2, top]]
    return np.concatenate(levels).astype("f4"), np.array(faces, "u2")


def still(twin: Twin, points: np.ndarray | None = None, **entries) -> dict:
    """Adds a mesh with one primitive and returns the primitive."""
    own, faces = tower()
    points = own if points is None else points
    primitive = {
        "attributes": {"POSITION": twin.accessor(points)},
        "indices": twin.accessor(faces.reshape(-1)),
        **entries,
    }
    twin.add("meshes", {"primitives": [primitive]})
    return primitive


def chain(twin: Twin, in_scene: bool = True, **middle) -> list[int]:
    """Adds a tower on three joints at heights of 0, 0.6 and 1.2 m. ``middle`` holds extra entries of the
    second joint's node.
    """
    points, _ = tower()
    joints = [twin.node(name="low", in_scene=in_scene)]
    joints.append(twin.node(joints[0], name="middle", translation=[0, 0.6, 0], **middle))
    joints.append(twin.node(joints[1], name="high", translation=[0, 0.6, 0]))
    inverse = np.tile(np.eye(4), (3, 1, 1))
    inverse[:, 3, 1] = [0, -0.6, -1.2]
    matrices = twin.accessor(inverse.reshape(3, 16).astype("f4"))
    twin.add("skins", {"joints": joints, "inverseBindMatrices": matrices})
    at = np.clip(points[:, 1] / 0.6, 0, 2)
    low = np.minimum(at.astype(int), 1)
    indices = np.zeros((len(points), 4), "u1")
    indices[:, 0], indices[:, 1] = low, low + 1
    weights = np.zeros((len(points), 4), "f4")
    weights[:, 1] = np.clip(at - low, 0, 1)
    weights[:, 0] = 1 - weights[:, 1]
    primitive = still(twin)
    primitive["attributes"] |= {"JOINTS_0": twin.accessor(indices), "WEIGHTS_0": twin.accessor(weights)}
    twin.node(mesh=len(twin.json["meshes"]) - 1, skin=0, name="tower")
    return joints


def waving(**middle) -> tuple[Twin, list[int]]:
    """Returns the chain with a clip that rotates its second joint back and forth."""
    twin = Twin()
    joints = chain(twin, **middle)
    back = [-HALF[0], -HALF[1], -HALF[2], HALF[3]]
    twin.channel(0, {"node": joints[1], "path": "rotation"}, [0, 0.5, 1], [[0, 0, 0, 1], HALF, back])
    return twin, joints


def quantised() -> Twin:
    twin = Twin()
    points, _ = tower()
    primitive = still(twin, points)
    short = np.zeros((len(points), 4), "i2")
    short[:, :3] = np.round(points / 2.0 * 32767)
    at = twin.accessor(short)
    twin.json["accessors"][at] |= {"type": "VEC3", "normalized": True}
    twin.json["bufferViews"][-1]["byteStride"] = 8
    primitive["attributes"]["POSITION"] = at
    twin.extension("KHR_mesh_quantization", True)
    twin.node(mesh=0, scale=[2, 2, 2])
    return twin


def sparse() -> Twin:
    twin = Twin()
    points, _ = tower()
    primitive = still(twin, points)
    accessor = twin.json["accessors"][primitive["attributes"]["POSITION"]]
    moved = (points[-4:] + np.array([0.3, 0, 0])).astype("f4")
    indices = {"bufferView": twin.view(np.arange(len(points) - 4, len(points)).astype("u2").tobytes())}
    accessor["sparse"] = {"count": 4, "indices": indices | {"componentType": 5123}}
    accessor["sparse"]["values"] = {"bufferView": twin.view(moved.tobytes())}
    twin.node(mesh=0)
    return twin


def two_skins() -> Twin:
    """Returns the chain with a second skinned part in centimetres. Only the inverse bind matrices of its skin
    contain its scale.
    """
    twin, joints = waving()
    part = json.loads(json.dumps(twin.json["meshes"][0]["primitives"][0]))
    points, _ = tower()
    part["attributes"]["POSITION"] = twin.accessor((points * [150, 100, 150]).astype("f4"))
    inverse = np.tile(np.diag([0.01, 0.01, 0.01, 1.0]), (3, 1, 1))
    inverse[:, 3, 1] = [0, -0.6, -1.2]
    matrices = twin.accessor(inverse.reshape(3, 16).astype("f4"))
    twin.add("skins", {"joints": joints, "inverseBindMatrices": matrices})
    twin.node(mesh=twin.add("meshes", {"primitives": [part]}), skin=1, name="coat")
    return twin


def hidden(popping: bool) -> Twin:
    """Returns the chain with a hat of scale 0. If ``popping``, a second clip scales it up."""
    twin = Twin()
    still(twin)
    points, faces = tower(2, 0.3)
    hat = {"attributes": {"POSITION": twin.accessor(points)}, "indices": twin.accessor(faces.reshape(-1))}
    twin.add("meshes", {"primitives": [hat]})
    body = twin.node(mesh=0, name="body")
    on_top = twin.node(body, mesh=1, name="hat", translation=[0, 1.6, 0], scale=[0, 0, 0])
    twin.channel(0, {"node": body, "path": "rotation"}, [0, 1], [[0, 0, 0, 1], HALF])
    if popping:
        twin.channel(1, {"node": on_top, "path": "scale"}, [0, 0.5, 1], [[0, 0, 0], [1, 1, 1], [1.2, 1, 1]])
    return twin


def flat_matrix() -> Twin:
    """Returns a part that its node's matrix flattens, like a fake shadow."""
    twin = Twin()
    still(twin)
    twin.node(mesh=0)
    flat = np.diag([1.0, 0.0, 1.0, 1.0])
    twin.node(mesh=0, matrix=flat.T.reshape(-1).tolist(), translation=None)
    twin.json["nodes"][1].pop("translation")
    return twin


def outside_the_scene() -> Twin:
    twin = Twin()
    chain(twin, in_scene=False)
    return twin


def mirrored_in_node() -> Twin:
    return waving(scale=[-1, 1, 1])[0]


def mirrored_unevenly() -> Twin:
    return waving(scale=[0.7, -1.3, 1.1])[0]


def scaled_unevenly() -> Twin:
    return waving(scale=[0.7, 1.3, 1.1])[0]


def scaled_parent() -> Twin:
    """Returns the chain below a joint that is mirrored and unevenly scaled, with rotating joints below it."""
    twin, joints = waving()
    twin.json["nodes"][joints[0]]["scale"] = [0.7, -1.3, 1.1]
    return twin


def scaled_chain() -> Twin:
    twin, joints = waving(scale=[0.7, -1.3, 1.1])
    twin.json["nodes"][joints[2]]["scale"] = [-1.0, 1.4, 1.0]
    return twin


def mirrored_parent() -> Twin:
    twin, joints = waving()
    twin.json["nodes"][joints[0]]["scale"] = [1, 1, -1]
    return twin


def mirrored_in_clip() -> Twin:
    twin, joints = waving()
    twin.channel(0, {"node": joints[2], "path": "scale"}, [0, 1], [[-1, 1, 1], [-1, 1, 1]])
    return twin


def instanced() -> Twin:
    twin = Twin()
    still(twin)
    turn = [0.0, float(np.sin(0.5)), 0.0, float(np.cos(0.5))]
    table = {
        "TRANSLATION": twin.accessor(np.array([[0, 0, 0], [1, 0, 0], [0, 0.5, 2]], "f4")),
        "ROTATION": twin.accessor(np.array([[0, 0, 0, 1], turn, [0, 0, 0, 1]], "f4")),
        "SCALE": twin.accessor(np.array([[1, 1, 1], [1, 2, 1], [-1, 1, 1]], "f4")),
    }
    twin.extension("EXT_mesh_gpu_instancing", True)
    twin.node(mesh=0, extensions={"EXT_mesh_gpu_instancing": {"attributes": table}})
    return twin


def invisible() -> Twin:
    twin = Twin()
    still(twin)
    twin.node(mesh=0, name="shown")
    away = twin.node(name="group", extensions={"KHR_node_visibility": {"visible": False}})
    twin.node(away, mesh=0, name="away", translation=[5, 0, 0])
    twin.extension("KHR_node_visibility")
    return twin


def pointed() -> Twin:
    """Returns the waving chain, animated by JSON pointers."""
    twin, _ = waving()
    for channel in twin.json["animations"][0]["channels"]:
        target = channel["target"]
        pointer = {"pointer": f"/nodes/{target['node']}/{target['path']}"}
        channel["target"] = {"path": "pointer", "extensions": {"KHR_animation_pointer": pointer}}
    twin.extension("KHR_animation_pointer")
    return twin


def morphed_at_rest() -> Twin:
    twin = Twin()
    primitive = still(twin)
    points, _ = tower()
    primitive["targets"] = [{"POSITION": twin.accessor((points * [1, 0, 1]).astype("f4"))}]
    twin.json["meshes"][0]["weights"] = [0.5]
    twin.node(mesh=0)
    return twin


def lit() -> Twin:
    twin = Twin()
    still(twin)
    twin.node(mesh=0)
    twin.extension("KHR_lights_punctual", True)
    return twin


TWINS: dict[str, Callable[[], Twin]] = {
    made.__name__: made
    for made in (
        quantised,
        sparse,
        two_skins,
        flat_matrix,
        outside_the_scene,
        mirrored_in_node,
        mirrored_unevenly,
        scaled_unevenly,
        scaled_parent,
        scaled_chain,
        mirrored_parent,
        mirrored_in_clip,
        instanced,
        invisible,
        pointed,
        morphed_at_rest,
        lit,
    )
} | {"hidden": lambda: hidden(False), "popping": lambda: hidden(True), "waving": lambda: waving()[0]}
"""All of these files by name."""
