"""Tests of models from untrusted sources and the files to which they refer: all are read by one checked
function.
"""

import base64
import io
import json
import os
import struct

import numpy as np
import pytest
from bounded import bounded
from PIL import Image

from enliven.errors import InputError
from enliven.files import ReferencedFiles, read_file
from enliven.formats.gltf.read import read_gltf
from enliven.meshes.files import load_mesh

DATA = struct.pack("<9f3H2x", 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 2)
TRIANGLE = {
    "asset": {"version": "2.0"},
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
    ],
}
INLINE = "data:application/octet-stream;base64," + base64.b64encode(DATA).decode()
READERS = [read_gltf, load_mesh]


def written(path, uri=INLINE, **changes):
    """Writes a glTF of one triangle. ``changes`` replace its entries."""
    document = {**TRIANGLE, "buffers": [{"byteLength": len(DATA), "uri": uri}], **changes}
    path.write_text(json.dumps(document))
    return path


@pytest.fixture
def folder(tmp_path):
    """Returns a model's folder, next to a file that the model must not read."""
    (tmp_path / "model" / "parts").mkdir(parents=True)
    (tmp_path / "secret.bin").write_bytes(DATA)
    (tmp_path / "model" / "parts" / "its data.bin").write_bytes(DATA)
    (tmp_path / "model" / "link.bin").symlink_to(tmp_path / "secret.bin")
    (tmp_path / "model" / "near.bin").symlink_to(tmp_path / "model" / "parts" / "its data.bin")
    (tmp_path / "model" / "loop.bin").symlink_to(tmp_path / "model" / "loop.bin")
    (tmp_path / "model" / "zero.bin").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "model" / "pipe.bin")
    with (tmp_path / "model" / "large.bin").open("wb") as file:
        file.truncate(1 << 40)
    return tmp_path / "model"


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize("uri", ["parts/its%20data.bin", "./parts/its data.bin", "near.bin", INLINE])
def test_files_below_the_model_are_read(folder, read, uri):
    assert read(written(folder / "a.gltf", uri))


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("../secret.bin", "outside"),
        ("%2e%2e/secret.bin", "outside"),
        ("parts/../../secret.bin", "outside"),
        ("/etc/passwd", "outside"),
        ("link.bin", "outside"),
        ("zero.bin", "outside"),
        ("pipe.bin", "pipe"),
        ("parts", "folder"),
        ("large.bin", "but at most"),
        ("none.bin", "the file does not exist"),
        ("http://localhost/a.bin", "the file does not exist"),
        ("a\0b", "cannot be read"),
        ("loop.bin", "cannot be read|outside"),
        ("a" * 5000, "cannot be read"),
    ],
)
def test_files_elsewhere_are_not_read(folder, read, uri, words):
    path = written(folder / "a.gltf", uri)
    with bounded(seconds=20), pytest.raises(InputError, match=words) as caught:
        read(path)
    assert str(path) in caught.value.where and caught.value.exit_code == 3


def test_total_size_of_referenced_files_is_bounded(tmp_path):
    (tmp_path / "a").write_bytes(bytes(60))
    beside = ReferencedFiles(tmp_path / "model.obj", max_bytes=100)
    assert len(beside.read_named_file("a")) == 60
    with pytest.raises(InputError, match="at most 40"):
        beside.read_named_file("a")


@pytest.mark.parametrize("name", ["pipe.bin", "zero.bin", "../secret.bin"])
def test_materials_and_textures_of_an_obj_are_checked(folder, name):
    path = folder / "a.obj"
    body = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n"
    path.write_text(f"mtllib {name}\n{body}")
    with bounded(seconds=20):
        assert load_mesh(path).mesh.area == 0.5
    (folder / "a.mtl").write_text(f"newmtl m\nKd 1 0 0\nmap_Kd {name}\n")
    path.write_text(f"mtllib a.mtl\n{body}")
    with bounded(seconds=20):
        np.testing.assert_array_equal(load_mesh(path).mesh.colours, [[255, 0, 0]] * 3)


@pytest.mark.parametrize("read", READERS)
def test_a_model_is_a_regular_file(tmp_path, read):
    os.mkfifo(tmp_path / "a.glb")
    with bounded(seconds=20), pytest.raises(InputError, match="not a regular file"):
        read(tmp_path / "a.glb")
    with (tmp_path / "b.glb").open("wb") as file:
        file.truncate(1 << 40)
    with bounded(), pytest.raises(InputError, match="but at most"):
        read(tmp_path / "b.glb")


CHAIN = [{"children": [k + 1]} for k in range(4000)] + [{"mesh": 0}]
CROWD = [{"mesh": 0}] * 60_000
MANY = [{"bufferView": 0, "componentType": 5126, "count": 10_000, "type": "VEC3"}, TRIANGLE["accessors"][1]]


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"accessors": [{"componentType": 5126, "count": 10**9, "type": "VEC3"}]}, "declares 1000000000"),
        ({"nodes": CHAIN}, "nested in more than"),
        ({"nodes": [{}] * 70_000}, "70000 nodes"),
        ({"nodes": CROWD, "accessors": MANY}, "600000000 vertices"),
        ({"nodes": [{"children": [1]}, {"children": [0], "mesh": 0}]}, "cycle"),
    ],
    ids=["accessor", "chain", "nodes", "instances", "cycle"],
)
def test_stated_sizes_are_checked_first(tmp_path, read, changes, words):
    path = written(tmp_path / "a.gltf", **changes)
    with bounded(300, 20), pytest.raises(InputError, match=words):
        read(path)


@pytest.mark.parametrize("read", READERS)
def test_json_nested_without_end_is_refused(tmp_path, read):
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(TRIANGLE)[:-1] + ', "extras": ' + "[" * 100_000)
    with bounded(), pytest.raises(InputError, match="nested too deep"):
        read(path)


def test_an_animation_that_lasts_for_years_is_refused(tmp_path):
    data = DATA + struct.pack("<4f", 0.0, 0.01, 0.02, 1e9) + struct.pack("<16f", *[0, 0, 0, 1] * 4)
    uri = "data:;base64," + base64.b64encode(data).decode()
    views = [*TRIANGLE["bufferViews"], {"buffer": 0, "byteOffset": 44, "byteLength": 16}]
    views.append({"buffer": 0, "byteOffset": 60, "byteLength": 64})
    accessors = [*TRIANGLE["accessors"]]
    accessors.append({"bufferView": 2, "componentType": 5126, "count": 4, "type": "SCALAR"})
    accessors.append({"bufferView": 3, "componentType": 5126, "count": 4, "type": "VEC4"})
    channel = {"sampler": 0, "target": {"node": 0, "path": "rotation"}}
    animation = {"channels": [channel], "samplers": [{"input": 2, "output": 3}]}
    path = written(
        tmp_path / "a.gltf",
        uri,
        bufferViews=views,
        accessors=accessors,
        animations=[animation],
        buffers=[{"byteLength": len(data), "uri": uri}],
    )
    with bounded(), pytest.raises(InputError, match="too many"):
        read_gltf(path)


@pytest.mark.slow
@pytest.mark.parametrize("side", [13_000, 17_000])
def test_image_with_false_size_is_left_out(tmp_path, side):
    out = io.BytesIO()
    Image.new("1", (side, side)).save(out, "PNG")
    assert len(out.getvalue()) < 200_000
    data = DATA + struct.pack("<6f", *[0.5] * 6)
    uri = "data:;base64," + base64.b64encode(data).decode()
    image = "data:image/png;base64," + base64.b64encode(out.getvalue()).decode()
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    primitive = {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0}
    path = written(
        tmp_path / "a.gltf",
        bufferViews=[*TRIANGLE["bufferViews"], {"buffer": 0, "byteOffset": 44, "byteLength": 24}],
        accessors=[
            *TRIANGLE["accessors"],
            {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2"},
        ],
        buffers=[{"byteLength": len(data), "uri": uri}],
        meshes=[{"primitives": [primitive]}],
        materials=[material],
        textures=[{"source": 0}],
        images=[{"uri": image}],
    )
    with bounded(400):
        rig = read_gltf(path)
    assert any("replaced by white" in note for note in rig.notes)
    assert (rig.shape.mesh.colours == 255).all()


def test_a_file_of_a_bounded_size_is_read_whole(tmp_path):
    (tmp_path / "a").write_bytes(b"12345")
    assert read_file(tmp_path / "a", 5) == b"12345"
    with pytest.raises(InputError, match="5 bytes, but at most 4"):
        read_file(tmp_path / "a", 4)
    for path in (tmp_path, tmp_path / "none", tmp_path / "a\0b"):
        with pytest.raises(InputError):
            read_file(path)
