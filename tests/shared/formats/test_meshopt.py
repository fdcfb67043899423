"""Tests that meshopt-compressed glTF files equal their uncompressed versions, also in files of other
programs.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import meshopt
import numpy as np
import pytest
from gltf_doors import READERS, measure_surface
from gltf_twins import TWINS, Twin
from hypothesis import given, settings
from hypothesis import strategies as st
from slow_gltf import SlowGltf
from test_gltf_kinds import compressed, packed_chain

from enliven.errors import InputError, ResourceError
from enliven.formats.gltf.read import read_gltf
from enliven.meshes import load_mesh
from enliven.meshes.gltf.compression import meshopt_bytes
from enliven.meshes.gltf.gltf_json import Entry

GLTFPACK = Path(__file__).parents[3] / "out" / "web" / "node_modules" / "gltfpack" / "cli.js"
NODE = shutil.which("node")
SIZES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def packed(kind: str, extension: str = "EXT_meshopt_compression", fallback: bool = False) -> Twin:
    """Returns a file in which the indices and every buffer view with rows of whole words are compressed."""
    twin, plain = Twin(), TWINS[kind]()
    twin.json, blob = plain.json, plain.blob
    users = {a["bufferView"]: a for a in plain.json["accessors"] if "bufferView" in a}
    indices = {p["indices"] for m in plain.json["meshes"] for p in m["primitives"] if "indices" in p}
    views = list(plain.json["bufferViews"])
    twin.json["bufferViews"] = []
    for number, view in enumerate(views):
        data = blob[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        accessor = users[number]
        size = view.get("byteStride", SIZES[accessor["componentType"]] * WIDTHS[accessor["type"]])
        mode = "TRIANGLES" if plain.json["accessors"].index(accessor) in indices else "ATTRIBUTES"
        if mode == "ATTRIBUTES" and size % 4:
            twin.view(data)  # rows of other sizes cannot be compressed
            continue
        data += b"\0" * (-len(data) % size)
        rows = np.frombuffer(data, np.uint8).reshape(-1, size)
        code = meshopt.encode_gltf_buffer(
            rows if mode == "ATTRIBUTES" else rows.reshape(-1).view(f"u{size}"), mode
        )
        own = twin.json["bufferViews"].pop(twin.view(code))
        own |= {"byteStride": size, "count": accessor["count"], "mode": mode}
        twin.view(data if fallback else b"")
        twin.json["bufferViews"][-1] |= {"byteLength": len(data), "extensions": {extension: own}}
        if "byteStride" in view:
            twin.json["bufferViews"][-1]["byteStride"] = size
    twin.extension(extension, not fallback)
    return twin


@pytest.mark.parametrize("extension", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
@pytest.mark.parametrize("kind", ["quantised", "two_skins", "waving", "mirrored_in_clip"])
def test_a_compressed_file_is_its_plain_twin(tmp_path, kind, extension):
    plain = read_gltf(TWINS[kind]().write(tmp_path / "a.glb"))
    path = packed(kind, extension).write(tmp_path / "b.glb")
    rig = read_gltf(path)
    np.testing.assert_array_equal(rig.shape.mesh.vertices, plain.shape.mesh.vertices)
    assert measure_surface((rig.shape.mesh.vertices, rig.shape.mesh.faces)) == pytest.approx(
        measure_surface((plain.shape.mesh.vertices, plain.shape.mesh.faces))
    )
    for clip, plain_clip in zip(rig.clips, plain.clips, strict=True):
        np.testing.assert_array_equal(clip.turns, plain_clip.turns)
    assert [note for note in rig.notes if "compression" in note] == []


def test_every_entry_point_reads_a_compressed_file(tmp_path):
    path = packed("waving").write(tmp_path / "a.glb")
    mesh = read_gltf(path).shape.mesh
    for name, door in READERS.items():
        shown = measure_surface(door(path))
        np.testing.assert_allclose(
            shown, measure_surface((mesh.vertices, mesh.faces)), rtol=2e-3, err_msg=name
        )


@pytest.mark.parametrize("module", ["meshopt", "DracoPy"])
def test_missing_decoder_error_names_file_and_package(tmp_path, monkeypatch, module):
    make = {"meshopt": lambda: packed("waving"), "DracoPy": lambda: compressed(packed_chain())}
    path = make[module]().write(tmp_path / "a.glb")
    monkeypatch.setitem(sys.modules, module, None)
    for name, door in READERS.items():
        with pytest.raises(ResourceError) as refused:
            door(path)
        assert str(refused.value).startswith(f"{path}: the file is compressed, but the library {module}"), (
            name
        )
        assert 'pip install "enliven[compressed]"' in refused.value.remedy, name


def unpacked(data: bytes, count: int, size: int, mode: str, how: str = "NONE") -> bytes:
    return meshopt_bytes(data, Entry({"count": count, "byteStride": size, "mode": mode, "filter": how}))


def test_rows_and_indices_come_back_bit_for_bit():
    random = np.random.default_rng(5)
    rows = random.integers(0, 256, (1000, 12), dtype=np.uint8)
    assert unpacked(meshopt.encode_gltf_buffer(rows, "ATTRIBUTES"), 1000, 12, "ATTRIBUTES") == rows.tobytes()
    for kind in (np.uint16, np.uint32):
        order = random.integers(0, 900, 3001).astype(kind)
        code = meshopt.encode_gltf_buffer(order, "INDICES")
        assert unpacked(code, 3001, kind().itemsize, "INDICES") == order.tobytes()


def slow_octahedral(rows: np.ndarray) -> np.ndarray:
    """Returns (N, 3) unit vectors of filtered int8 or int16 rows (N, 4): x, y, one, unused, as the extension
    defines them.
    """
    x, y, scale = (rows[:, k].astype(float) for k in range(3))
    x, y = x / scale, y / scale
    z = 1 - abs(x) - abs(y)
    t = np.maximum(-z, 0.0)
    x, y = x - np.where(x >= 0, t, -t), y - np.where(y >= 0, t, -t)
    return np.stack([x, y, z], 1) / np.sqrt(x * x + y * y + z * z)[:, None]


def slow_quaternion(rows: np.ndarray) -> np.ndarray:
    """Returns (N, 4) unit quaternions of filtered int16 rows: three components, then scale and the index of
    the largest.
    """
    scale = (rows[:, 3] | 3).astype(float)
    three = rows[:, :3] / scale[:, None] / np.sqrt(2)
    four = np.sqrt(np.maximum(1 - (three**2).sum(1), 0.0))
    quaternions, most = np.zeros((len(rows), 4)), rows[:, 3] & 3
    for row, place in enumerate(most):
        for k in range(3):
            quaternions[row, (place + 1 + k) % 4] = three[row, k]
        quaternions[row, place] = four[row]
    return quaternions


def slow_exponential(rows: np.ndarray) -> np.ndarray:
    """Returns the numbers of filtered int32 values: a mantissa of 24 bits and an exponent of 8."""
    exponent = rows >> 24
    mantissa = (rows << 8) >> 8
    return mantissa * 2.0**exponent


@pytest.mark.parametrize("kind", [np.int8, np.int16])
def test_octahedral_rows_are_unit_vectors(kind):
    random, largest = np.random.default_rng(1), np.iinfo(kind).max
    rows = random.integers(-largest, largest, (200, 4)).astype(kind)
    rows[:, 2] = largest
    code = meshopt.encode_gltf_buffer(rows, "ATTRIBUTES")
    decoded = np.frombuffer(unpacked(code, 200, 4 * kind().itemsize, "ATTRIBUTES", "OCTAHEDRAL"), kind)
    np.testing.assert_allclose(
        decoded.reshape(-1, 4)[:, :3] / largest, slow_octahedral(rows), atol=1.01 / largest
    )


def test_quaternion_rows_are_unit_quaternions():
    random = np.random.default_rng(2)
    rows = random.integers(-18000, 18000, (200, 4)).astype(np.int16)
    rows[:, 3] = (32767 & ~3) | random.integers(0, 4, 200)
    code = meshopt.encode_gltf_buffer(rows, "ATTRIBUTES")
    decoded = np.frombuffer(unpacked(code, 200, 8, "ATTRIBUTES", "QUATERNION"), np.int16).reshape(-1, 4)
    np.testing.assert_allclose(decoded / 32767, slow_quaternion(rows), atol=2 / 32767)


def test_exponential_rows_are_floats():
    random = np.random.default_rng(3)
    rows = ((random.integers(-20, 20, 300) << 24) | random.integers(0, 1 << 24, 300)).astype(np.int32)
    code = meshopt.encode_gltf_buffer(rows.reshape(-1, 3), "ATTRIBUTES")
    decoded = np.frombuffer(unpacked(code, 100, 12, "ATTRIBUTES", "EXPONENTIAL"), np.float32)
    np.testing.assert_array_equal(decoded, slow_exponential(rows).astype(np.float32))


@settings(max_examples=60)
@given(st.data())
def test_damaged_bytes_are_refused_or_of_their_size(data):
    mode, size = data.draw(st.sampled_from([("ATTRIBUTES", 12), ("TRIANGLES", 2), ("INDICES", 4)]))
    rows = np.arange(300 * 12, dtype=np.uint8).reshape(-1, 12)
    order = (np.arange(300) // 2).astype(np.uint16 if size == 2 else np.uint32)
    code = bytearray(meshopt.encode_gltf_buffer(rows if mode == "ATTRIBUTES" else order, mode))
    for _ in range(data.draw(st.integers(0, 6))):
        code[data.draw(st.integers(0, len(code) - 1))] = data.draw(st.integers(0, 255))
    count = data.draw(st.sampled_from([300, 3, 303, 300_000]))
    kept = bytes(code[: data.draw(st.integers(0, len(code)))])
    try:
        assert len(unpacked(kept, count, size, mode)) == count * size
    except InputError as error:
        assert "damaged" in error.what


@pytest.mark.parametrize("read", [read_gltf, load_mesh])
@pytest.mark.parametrize(
    "change",
    [
        {"count": 10**9}, {"count": -3}, {"count": True}, {"count": "many"}, {"byteStride": 6},
        {"byteStride": 0}, {"mode": "SOMETHING"}, {"filter": "COLOURS"}, {"filter": "QUATERNION"},
        {"byteLength": 10**8}, {"byteOffset": 10**8}, {"buffer": 7}, {"count": None}, {"byteLength": 3},
    ],
)  # fmt: skip
def test_wrong_numbers_are_refused_with_the_view(tmp_path, read, change):
    twin = packed("waving")
    first = next(v for v in twin.json["bufferViews"] if "extensions" in v)
    first["extensions"]["EXT_meshopt_compression"] |= change
    with pytest.raises(InputError) as caught:
        read(twin.write(tmp_path / "a.glb"))
    assert "Error" not in caught.value.what and "Traceback" not in caught.value.what
    assert str(tmp_path) in caught.value.where


def test_an_optional_compression_and_its_plain_data_agree(tmp_path):
    path = packed("two_skins", fallback=True).write(tmp_path / "a.glb")
    expected = SlowGltf(path).vertices_at(None, 0.0)
    np.testing.assert_allclose(read_gltf(path).shape.mesh.vertices, expected, atol=5e-5)


@pytest.mark.skipif(NODE is None or not GLTFPACK.is_file(), reason="gltfpack is not here: make test-web")
@pytest.mark.parametrize("level", ["-c", "-cc"])
def test_gltfpack_output_is_read(tmp_path, level):
    path, out = TWINS["waving"]().write(tmp_path / "a.glb"), tmp_path / "b.glb"
    subprocess.run([str(NODE), str(GLTFPACK), "-i", path, "-o", out, level, "-noq", "-kn"], check=True)
    assert b"meshopt_compression" in out.read_bytes()
    plain, rig = read_gltf(path), read_gltf(out)
    for axis in range(2):
        np.testing.assert_allclose(rig.shape.mesh.bounds[axis], plain.shape.mesh.bounds[axis], atol=2e-3)
    assert rig.clips[0].duration == pytest.approx(plain.clips[0].duration, abs=0.05)
