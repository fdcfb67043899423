"""Hand-made rigged glTF files that use unusual but valid features, as a stress test for the reader."""

from __future__ import annotations

import base64
import json

import numpy as np
from slow_gltf import rotation_matrix

KIND = {
    np.dtype(kind): number
    for kind, number in (
        ("i1", 5120), ("u1", 5121), ("i2", 5122), ("u2", 5123), ("u4", 5125), ("f4", 5126)
    )
}  # fmt: skip
TYPE = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class GltfBuilder:
    """A glTF document under construction. Its only buffer is embedded in the text."""

    def __init__(self) -> None:
        self.json: dict = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "accessors": [],
            "bufferViews": [],
        }
        self.blob = b""

    def view(self, data: bytes, stride: int | None = None) -> int:
        self.blob += b"\0" * (-len(self.blob) % 4)
        view = {"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data)}
        if stride:
            view["byteStride"] = stride
        self.json["bufferViews"].append(view)
        self.blob += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, array: np.ndarray, *, normalized=False, stride: int | None = None) -> int:
        array = np.ascontiguousarray(array)
        rows = array.reshape(len(array), -1)
        data = rows.tobytes()
        if stride:
            width = rows.shape[1] * rows.itemsize
            data = b"".join(r.tobytes() + b"\xee" * (stride - width) for r in rows)
        entry = {
            "bufferView": self.view(data, stride),
            "componentType": KIND[array.dtype],
            "count": len(rows),
            "type": TYPE[rows.shape[1]],
        }
        if normalized:
            entry["normalized"] = True
        self.json["accessors"].append(entry)
        return len(self.json["accessors"]) - 1

    def sparse(self, array: np.ndarray, at: np.ndarray) -> int:
        """Adds an accessor with the rows ``at`` of a float32 array, over zeros."""
        self.json["accessors"].append(
            {
                "componentType": 5126,
                "count": len(array),
                "type": TYPE[array.shape[1]],
                "sparse": {
                    "count": len(at),
                    "indices": {
                        "bufferView": self.view(at.astype(np.uint16).tobytes()),
                        "componentType": 5123,
                    },
                    "values": {"bufferView": self.view(array[at].tobytes())},
                },
            }
        )
        return len(self.json["accessors"]) - 1

    def node(self, parent: int | None = None, **entries) -> int:
        self.json["nodes"].append({k: v for k, v in entries.items() if v is not None})
        number = len(self.json["nodes"]) - 1
        if parent is None:
            self.json["scenes"][0]["nodes"].append(number)
        else:
            self.json["nodes"][parent].setdefault("children", []).append(number)
        return number

    def add(self, kind: str, entry: dict) -> int:
        self.json.setdefault(kind, []).append(entry)
        return len(self.json[kind]) - 1

    def write(self, path):
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.blob).decode()
        self.json["buffers"] = [{"byteLength": len(self.blob), "uri": uri}]
        path.write_text(json.dumps(self.json))
        return path


def trs(translation, rotation, scale=1.0) -> np.ndarray:
    m = np.eye(4)
    m[:3, :3] = rotation_matrix(np.asarray(rotation)) * scale
    m[:3, 3] = translation
    return m


def unit(random, size=1.0):
    q = np.array([0, 0, 0, 1.0]) * (1 - size) + size * random.normal(size=4)
    return q / np.linalg.norm(q)


def random_rig(seed: int, path, joints: int = 7, stretched: float | None = None):
    """Writes a rig with rotating joints (its root also travels), with as many unusual features as possible.

    If ``stretched`` is given, joints are also translated and scaled. Their scale factors differ by that
    amount per axis.
    """
    random = np.random.default_rng(seed)
    gltf = GltfBuilder()
    top = gltf.node(name="world", scale=[0.5, 0.5, 0.5])
    armature = gltf.node(top, name="armature", scale=[40.0] * 3, rotation=unit(random).tolist())
    base = trs([0, 0, 0], [0, 0, 0, 1], 0.5) @ trs([0, 0, 0], gltf.json["nodes"][armature]["rotation"], 40.0)
    parents = [-1] + [int(random.integers(max(0, j - 3), j)) for j in range(1, joints)]
    offsets = random.normal(size=(joints, 3)) * 0.02
    bind, nodes = [], []
    for j, parent in enumerate(parents):
        above = armature if parent < 0 else nodes[parent]
        default, bound = unit(random), unit(random)
        if j % 4 == 3:
            # A node between two joints that is not a joint. It has a matrix and is therefore never animated.
            between = trs(random.normal(size=3) * 0.01, unit(random))
            above = gltf.node(above, matrix=between.T.reshape(-1).tolist())
        nodes.append(
            gltf.node(above, name=f"j{j}", translation=offsets[j].tolist(), rotation=default.tolist())
        )
        before = base if parent < 0 else bind[parent]
        step = between if j % 4 == 3 else np.eye(4)
        bind.append(before @ step @ trs(offsets[j], bound))
    _meshes(gltf, random, nodes, bind)
    _animation(gltf, random, nodes)
    if stretched is not None:
        _stretches(gltf, random, nodes, offsets, stretched)
    return gltf.write(path)


def _meshes(made: GltfBuilder, random, nodes, bind) -> None:
    """Adds two meshes with two skins over the same joints, in different orders, spaces and encodings."""
    for number in range(2):
        order = random.permutation(len(nodes)) if number else np.arange(len(nodes))
        space = trs(random.normal(size=3), unit(random), 20.0 * (1 + number))
        inverse = np.stack([np.linalg.inv(bind[k]) @ space for k in order])
        columns = inverse.transpose(0, 2, 1).reshape(-1, 16).astype(np.float32)
        skin = {"joints": [nodes[k] for k in order], "inverseBindMatrices": made.accessor(columns)}
        made.add("skins", skin)
        count = 24
        near = random.integers(0, len(nodes), count)
        world = np.stack([bind[k][:3, 3] for k in near]) + random.normal(size=(count, 3)) * 0.1
        local = (np.linalg.inv(space) @ np.c_[world, np.ones(count)].T).T[:, :3].astype(np.float32)
        chosen = np.stack([random.permutation(len(nodes))[: 5 if number else 4] for _ in range(count)])
        weights = random.uniform(0.2, 1.0, chosen.shape)
        primitives = [_primitive(made, random, number, half, local, chosen, weights) for half in range(2)]
        mesh = made.add("meshes", {"primitives": primitives})
        matrix = trs(random.normal(size=3) * 5, unit(random), 3.0) if number else space
        made.node(mesh=mesh, skin=number, matrix=matrix.T.reshape(-1).tolist())


def _primitive(made, random, number, half, local, chosen, weights):
    """Adds half of a mesh. The first mesh has byte weights; the second has five joints per vertex in two
    sets."""
    part = slice(half * 12, half * 12 + 12)
    points, joints, shares = local[part], chosen[part], weights[part]
    if number == 0:
        shares = shares / shares.sum(1, keepdims=True)
        bytes_ = np.floor(shares * 255).astype(np.uint8)
        bytes_[:, 0] += (255 - bytes_.astype(int).sum(1)).astype(np.uint8)
        attributes = {
            "POSITION": made.accessor(points, stride=24) if half else made.sparse(points, np.arange(12)),
            "JOINTS_0": made.accessor(joints.astype(np.uint8)),
            "WEIGHTS_0": made.accessor(bytes_, normalized=True),
        }
    else:
        joints = np.c_[joints, np.zeros((12, 3), int)]
        shares = np.c_[shares, np.zeros((12, 3))]
        # The fifth weight, which the reader drops, is exactly zero.
        shares[np.arange(12), shares[:, :5].argmin(1)] = 0.0
        shares = (shares / shares.sum(1, keepdims=True)).astype(np.float32)
        attributes = {
            "POSITION": made.accessor(points),
            "JOINTS_0": made.accessor(joints[:, :4].astype(np.uint16)),
            "WEIGHTS_0": made.accessor(shares[:, :4]),
            "JOINTS_1": made.accessor(joints[:, 4:].astype(np.uint8)),
            "WEIGHTS_1": made.accessor(np.round(shares[:, 4:] * 65535).astype(np.uint16), normalized=True)
            if half
            else made.accessor(shares[:, 4:]),
        }
    primitive = {"attributes": attributes}
    if half:
        primitive["mode"] = 5
        primitive["indices"] = made.accessor(random.permutation(12).astype(np.uint16))
    return primitive


def _animation(made: GltfBuilder, random, nodes) -> None:
    channels, samplers = [], []
    times = made.accessor((np.arange(7) * 0.125).astype(np.float32))
    for j, node in enumerate(nodes):
        how = ["LINEAR", "CUBICSPLINE", "STEP"][j % 3]
        values = np.stack([unit(random, 0.6) for _ in range(7)])
        if how == "CUBICSPLINE":
            values = np.stack([random.normal(size=(7, 4)), values, random.normal(size=(7, 4))], 1)
        samplers.append(
            {
                "input": times,
                "output": made.accessor(values.reshape(-1, 4).astype(np.float32)),
                "interpolation": how,
            }
        )
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": "rotation"}})
    moved = made.accessor((random.normal(size=(7, 3)) * 0.02).astype(np.float32))
    samplers.append({"input": times, "output": moved})
    channels.append({"sampler": len(samplers) - 1, "target": {"node": nodes[0], "path": "translation"}})
    made.add("animations", {"name": "odd", "channels": channels, "samplers": samplers})


def _stretches(made: GltfBuilder, random, nodes, offsets, uneven: float) -> None:
    """Adds translation and scale tracks in addition to the rotations."""
    (animation,) = made.json["animations"]
    times = made.accessor((np.arange(7) * 0.125).astype(np.float32))
    for j, node in enumerate(nodes):
        moved = offsets[j] + random.normal(size=(7, 3)) * 0.01
        tracks = {"scale": np.exp(0.2 * random.normal(size=(7, 1)) + uneven * random.normal(size=(7, 3)))}
        tracks |= {"translation": moved} if j else {}
        for path, values in tracks.items():
            sampler = {"input": times, "output": made.accessor(values.astype(np.float32))}
            animation["samplers"].append(sampler)
            target = {"node": node, "path": path}
            animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})
