"""A strict checker for GLB files: the requirements of the specification, and a few more.

It shares no code with the package. One exported file of every kind was also checked with Khronos'
glTF-Validator, which found no error, warning or hint.
"""

from __future__ import annotations

import json
import struct

import numpy as np

KIND = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963


def checked_glb(data: bytes) -> dict:
    """Returns the JSON of a GLB. Fails an assertion if the file violates a requirement."""
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data)) and length % 4 == 0
    size, kind = struct.unpack("<I4s", data[12:20])
    assert kind == b"JSON" and size % 4 == 0
    document = json.loads(data[20 : 20 + size])
    binary, kind = struct.unpack("<I4s", data[20 + size : 28 + size])
    blob = data[28 + size :]
    assert kind == b"BIN\0" and binary == len(blob) and binary % 4 == 0
    (buffer,) = document["buffers"]
    assert 0 <= len(blob) - buffer["byteLength"] < 4 and "uri" not in buffer
    arrays = [_accessor(document, blob, entry) for entry in document["accessors"]]
    used = _nodes(document, arrays)
    used |= _skins(document, arrays)
    used |= _meshes(document, arrays)
    used |= _animations(document, arrays)
    assert used == set(range(len(arrays))), "an accessor that nobody uses"
    _names_nothing_empty(document)
    return document


def _accessor(document: dict, blob: bytes, entry: dict) -> np.ndarray:
    view = document["bufferViews"][entry["bufferView"]]
    kind, width = np.dtype(KIND[entry["componentType"]]), WIDTH[entry["type"]]
    start = view.get("byteOffset", 0)
    assert view["buffer"] == 0 and start % 4 == 0 and entry.get("byteOffset", 0) == 0
    assert (
        ("byteStride" not in view and (kind.itemsize * width) % 4 == 0)
        or "target" not in view
        or (view["target"] == ELEMENT_ARRAY_BUFFER)
    )
    assert entry["count"] >= 1 and view["byteLength"] == entry["count"] * width * kind.itemsize
    assert start + view["byteLength"] <= document["buffers"][0]["byteLength"]
    array = np.frombuffer(blob, kind, entry["count"] * width, start).reshape(-1, width)
    assert np.isfinite(array.astype(float)).all()
    assert np.array_equal(np.array(entry["min"], kind), array.min(0))
    assert np.array_equal(np.array(entry["max"], kind), array.max(0))
    assert [float(kind.type(x)) for x in entry["max"]] == entry["max"], "no number of that type"
    return array / np.iinfo(kind).max if entry.get("normalized") else array


def _nodes(document: dict, arrays: list[np.ndarray]) -> set[int]:
    parents: dict[int, int] = {}
    for number, node in enumerate(document["nodes"]):
        for child in node.get("children", []):
            assert 0 <= child < len(document["nodes"]) and child not in parents
            parents[child] = number
        assert node.get("children", [0]), "an empty list of children"
        if "rotation" in node:
            assert abs(np.linalg.norm(node["rotation"]) - 1) < 1e-6
        assert ("skin" in node) <= ("mesh" in node)
    roots = set(range(len(document["nodes"]))) - set(parents)
    assert sorted(document["scenes"][document["scene"]]["nodes"]) == sorted(roots)
    return set()


def _skins(document: dict, arrays: list[np.ndarray]) -> set[int]:
    parents = {c: n for n, node in enumerate(document["nodes"]) for c in node.get("children", [])}
    used = set()
    for skin in document.get("skins", []):
        joints = skin["joints"]
        assert len(set(joints)) == len(joints)
        inverse = arrays[skin["inverseBindMatrices"]]
        assert inverse.shape == (len(joints), 16)
        assert (inverse[:, [3, 7, 11]] == 0).all() and (inverse[:, 15] == 1).all()
        for joint in joints:
            at = joint
            while at != skin["skeleton"]:
                at = parents[at]
        used.add(skin["inverseBindMatrices"])
    return used


def _meshes(document: dict, arrays: list[np.ndarray]) -> set[int]:
    used = set()
    shown = [node for node in document["nodes"] if "mesh" in node]
    assert {node["mesh"] for node in shown} == set(range(len(document.get("meshes", []))))
    skins = {node["mesh"]: document["skins"][node["skin"]] for node in shown if "skin" in node}
    for number, mesh in enumerate(document.get("meshes", [])):
        for primitive in mesh["primitives"]:
            a = primitive["attributes"]
            used |= set(a.values()) | {primitive["indices"]}
            count = len(arrays[a["POSITION"]])
            assert all(len(arrays[v]) == count for v in a.values())
            for v in a.values():
                view = document["bufferViews"][document["accessors"][v]["bufferView"]]
                assert view["target"] == ARRAY_BUFFER
            indices = arrays[primitive["indices"]]
            assert len(indices) % 3 == 0 and indices.max() < count
            assert indices.max() < np.iinfo(indices.dtype).max, "the restart index"
            assert np.allclose(np.linalg.norm(arrays[a["NORMAL"]], axis=1), 1, atol=1e-5)
            targets = primitive.get("targets", [])
            assert len(mesh.get("weights", [])) == len(targets)
            for target in targets:
                used |= set(target.values())
                assert set(target) == {"POSITION", "NORMAL"}
                assert all(len(arrays[v]) == count for v in target.values())
            if "COLOR_0" in a:
                assert (arrays[a["COLOR_0"]] <= 1).all()
            assert 0 <= primitive["material"] < len(document["materials"])
            if number not in skins:
                assert not {"JOINTS_0", "WEIGHTS_0"} & set(a)
                continue
            joints, weights = arrays[a["JOINTS_0"]].astype(int), arrays[a["WEIGHTS_0"]]
            assert joints.max() < len(skins[number]["joints"])
            assert (weights >= 0).all() and np.abs(weights.astype(float).sum(1) - 1).max() < 1e-6
            assert (joints[weights == 0] == 0).all()
            named = np.where(weights > 0, joints, -1 - np.arange(4))
            assert (np.diff(np.sort(named, 1), axis=1) != 0).all(), "a joint twice in a vertex"
    return used


def _animations(document: dict, arrays: list[np.ndarray]) -> set[int]:
    used = set()
    for animation in document.get("animations", []):
        assert animation["channels"]
        targets = [(c["target"]["node"], c["target"]["path"]) for c in animation["channels"]]
        assert len(set(targets)) == len(targets)
        assert {c["sampler"] for c in animation["channels"]} == set(range(len(animation["samplers"])))
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            times, values = arrays[sampler["input"]][:, 0], arrays[sampler["output"]]
            used |= {sampler["input"], sampler["output"]}
            node, path = document["nodes"][channel["target"]["node"]], channel["target"]["path"]
            each = len(document["meshes"][node["mesh"]]["weights"]) if path == "weights" else 1
            how = sampler.get("interpolation", "LINEAR")
            assert how in ("LINEAR", "STEP", "CUBICSPLINE")
            each *= 3 if how == "CUBICSPLINE" else 1
            assert times[0] >= 0 and (np.diff(times) > 0).all() and len(values) == each * len(times)
            if path == "rotation":
                values = values[1::3] if how == "CUBICSPLINE" else values
                assert values.shape[1] == 4 and np.abs(np.linalg.norm(values, axis=1) - 1).max() < 1e-6
                assert how != "LINEAR" or ((values[1:] * values[:-1]).sum(1) > 0).all(), "the long way round"
            else:
                assert path in ("translation", "scale", "weights")
                assert values.shape[1] == (1 if path == "weights" else 3)
    return used


def _names_nothing_empty(document: dict) -> None:
    for key, value in document.items():
        assert value != [] and value != {}, f"{key} is empty"
