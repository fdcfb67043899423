"""glTF skinning written directly from the specification, one vertex at a time, as a reference for reader and
writer.

It shares no code with the package: json and struct read the file.
"""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path

import numpy as np

KINDS = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
TOP = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}


class SlowGltf:
    """A glTF file whose vertices can be computed at any time of one of its animations."""

    def __init__(self, path: Path) -> None:
        data = Path(path).read_bytes()
        if data[:4] == b"glTF":
            length = struct.unpack("<I", data[12:16])[0]
            self.json = json.loads(data[20 : 20 + length])
            blob = data[28 + length :]
        else:
            self.json, blob = json.loads(data), b""
        self.buffers, self.known = [], {}
        for buffer in self.json.get("buffers", []):
            uri = buffer.get("uri")
            self.buffers.append(blob if uri is None else base64.b64decode(uri.split(",", 1)[1]))

    def accessor(self, index: int) -> np.ndarray:
        if index not in self.known:
            self.known[index] = self._accessor(index)
        return self.known[index]

    def _accessor(self, index: int) -> np.ndarray:
        a = self.json["accessors"][index]
        kind, width = KINDS[a["componentType"]], WIDTHS[a["type"]]
        rows = [[0.0] * width for _ in range(a["count"])]
        if "bufferView" in a:
            rows = self._rows(a["bufferView"], a.get("byteOffset", 0), kind, a["count"], width)
        if "sparse" in a:
            s = a["sparse"]
            i, v = s["indices"], s["values"]
            at = self._rows(i["bufferView"], i.get("byteOffset", 0), KINDS[i["componentType"]], s["count"], 1)
            new = self._rows(v["bufferView"], v.get("byteOffset", 0), kind, s["count"], width)
            for (row,), values in zip(at, new, strict=True):
                rows[int(row)] = values
        out = np.array(rows, float)
        return np.maximum(out / TOP[a["componentType"]], -1) if a.get("normalized") else out

    def _rows(self, view: int, offset: int, kind: str, count: int, width: int) -> list[list[float]]:
        v = self.json["bufferViews"][view]
        size = struct.calcsize("<" + kind) * width
        start = v.get("byteOffset", 0) + offset
        step = v.get("byteStride", size)
        data = self.buffers[v["buffer"]]
        return [list(struct.unpack_from(f"<{width}{kind}", data, start + n * step)) for n in range(count)]

    def locals_at(self, animation: int | None, time: float) -> list[np.ndarray]:
        """Returns (4, 4) local transforms of each node."""
        trs = []
        for node in self.json["nodes"]:
            trs.append(
                {
                    "translation": np.array(node.get("translation", [0, 0, 0]), float),
                    "rotation": np.array(node.get("rotation", [0, 0, 0, 1]), float),
                    "scale": np.array(node.get("scale", [1, 1, 1]), float),
                }
            )
        if animation is not None:
            animation_json = self.json["animations"][animation]
            for channel in animation_json["channels"]:
                target, sampler = channel["target"], animation_json["samplers"][channel["sampler"]]
                if "node" in target and target["path"] != "weights":
                    trs[target["node"]][target["path"]] = self._sampled(sampler, target["path"], time)
        out = []
        for node, t in zip(self.json["nodes"], trs, strict=True):
            if "matrix" in node:
                out.append(np.array(node["matrix"], float).reshape(4, 4).T)
                continue
            m = np.eye(4)
            m[:3, :3] = rotation_matrix(t["rotation"]) @ np.diag(t["scale"])
            m[:3, 3] = t["translation"]
            out.append(m)
        return out

    def _sampled(self, sampler: dict, path: str, time: float) -> np.ndarray:
        keys, values = self.accessor(sampler["input"])[:, 0], self.accessor(sampler["output"])
        how = sampler.get("interpolation", "LINEAR")
        points = values[1::3] if how == "CUBICSPLINE" else values
        if time <= keys[0]:
            return points[0]
        if time >= keys[-1]:
            return points[-1]
        k = max(i for i in range(len(keys)) if keys[i] <= time)
        gap = keys[k + 1] - keys[k]
        s = (time - keys[k]) / gap
        if how == "STEP":
            return points[k]
        if how == "CUBICSPLINE":
            p = (
                (2 * s**3 - 3 * s**2 + 1) * points[k]
                + gap * (s**3 - 2 * s**2 + s) * values[3 * k + 2]
                + (3 * s**2 - 2 * s**3) * points[k + 1]
                + gap * (s**3 - s**2) * values[3 * k + 3]
            )
            return p / np.linalg.norm(p) if path == "rotation" else p
        if path != "rotation":
            return points[k] + s * (points[k + 1] - points[k])
        a, b = points[k] / np.linalg.norm(points[k]), points[k + 1] / np.linalg.norm(points[k + 1])
        if a @ b < 0:
            b = -b
        angle = np.arccos(np.clip(a @ b, -1, 1))
        if angle < 1e-6:
            return a
        return (np.sin((1 - s) * angle) * a + np.sin(s * angle) * b) / np.sin(angle)

    def weights_at(self, animation: int | None, time: float, node: int) -> np.ndarray:
        """Returns (N,) weights of the morph targets of a node's mesh."""
        mesh = self.json["meshes"][self.json["nodes"][node]["mesh"]]
        rest = np.array(self.json["nodes"][node].get("weights", mesh.get("weights", [])), float)
        if animation is None:
            return rest
        animation_json = self.json["animations"][animation]
        for channel in animation_json["channels"]:
            if channel["target"] == {"node": node, "path": "weights"}:
                sampler = animation_json["samplers"][channel["sampler"]]
                keys = self.accessor(sampler["input"])[:, 0]
                rows = self.accessor(sampler["output"])[:, 0].reshape(len(keys), -1)
                return np.array([np.interp(time, keys, column) for column in rows.T])
        return rest

    def world_at(self, animation: int | None, time: float) -> list[np.ndarray]:
        local = self.locals_at(animation, time)
        parent = {c: n for n, node in enumerate(self.json["nodes"]) for c in node.get("children", [])}

        def world(n: int) -> np.ndarray:
            return world(parent[n]) @ local[n] if n in parent else local[n]

        return [world(n) for n in range(len(local))]

    def vertices_at(self, animation: int | None, time: float, every: int = 1) -> np.ndarray:
        """Returns (V, 3) every ``every``-th vertex of the scene, in the order of nodes, primitives and
        vertices."""
        world, out = self.world_at(animation, time), []
        scene = self.json["scenes"][self.json.get("scene", 0)]["nodes"] if "scenes" in self.json else []
        waiting = list(reversed(scene))
        number = 0
        while waiting:
            n = waiting.pop()
            node = self.json["nodes"][n]
            waiting.extend(reversed(node.get("children", [])))
            if "mesh" not in node:
                continue
            for primitive in self.json["meshes"][node["mesh"]]["primitives"]:
                attributes = primitive["attributes"]
                points = self.accessor(attributes["POSITION"])
                weights = self.weights_at(animation, time, n)
                for w, target in zip(weights, primitive.get("targets", []), strict=True):
                    points = points + w * self.accessor(target["POSITION"])
                if "skin" not in node or "JOINTS_0" not in attributes:
                    for v in points:
                        if number % every == 0:
                            out.append((world[n] @ np.append(v, 1))[:3])
                        number += 1
                    continue
                skin = self.json["skins"][node["skin"]]
                count = len(skin["joints"])
                inverse = [np.eye(4)] * count
                if "inverseBindMatrices" in skin:
                    read = self.accessor(skin["inverseBindMatrices"])
                    inverse = [m.reshape(4, 4).T for m in read]
                moved = [world[j] @ m for j, m in zip(skin["joints"], inverse, strict=False)]
                sets = [k for k in range(4) if f"JOINTS_{k}" in attributes]
                joints = np.hstack([self.accessor(attributes[f"JOINTS_{k}"]) for k in sets]).astype(int)
                weights = np.hstack([self.accessor(attributes[f"WEIGHTS_{k}"]) for k in sets])
                for v, js, ws in zip(points, joints, weights, strict=True):
                    if number % every == 0:
                        blend = sum(w * moved[j] for j, w in zip(js, ws, strict=True) if w > 0)
                        out.append((blend @ np.append(v, 1))[:3] / ws.sum())
                    number += 1
        return np.array(out)


def rotation_matrix(q: np.ndarray) -> np.ndarray:
    """Returns (3, 3) the rotation matrix of a quaternion (x, y, z, w) of any length. It rotates vectors by q
    v q*.
    """
    x, y, z, w = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
