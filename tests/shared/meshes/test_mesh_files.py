"""Tests of reading and writing meshes. Every kind of bad file gives one clear error."""

import json
import struct

import numpy as np
import pytest

from enliven.errors import InputError, ResourceError
from enliven.meshes.files import WRITABLE, load_mesh, load_upright, save_mesh
from enliven.meshes.mesh import Mesh
from enliven.meshes.polygons import triangulate

TETRAHEDRON = Mesh(
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
    "tetrahedron",
)


@pytest.mark.parametrize("suffix", WRITABLE)
def test_mesh_survives_writing_and_reading(tmp_path, suffix):
    path = tmp_path / f"t{suffix}"
    save_mesh(TETRAHEDRON, path)
    mesh, notes = load_mesh(path)
    assert mesh.name == "t"
    assert mesh.area == pytest.approx(TETRAHEDRON.area)
    centres = np.array(sorted(mesh.vertices[mesh.faces].mean(1).tolist()))
    np.testing.assert_allclose(
        centres, sorted(TETRAHEDRON.vertices[TETRAHEDRON.faces].mean(1).tolist()), atol=1e-6
    )
    assert len(mesh.vertices) == 4
    assert all("welded" in note for note in notes)


def test_colours_survive_ply(tmp_path):
    colours = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 9, 9]], np.uint8)
    path = tmp_path / "c.ply"
    save_mesh(Mesh(TETRAHEDRON.vertices, TETRAHEDRON.faces, "c", colours), path)
    np.testing.assert_array_equal(load_mesh(path).mesh.colours, colours)


def write_gltf(path, nodes, cut=0):
    """Writes a glTF with one triangle below the given nodes. The last ``cut`` bytes of its buffer are
    missing.
    """
    data = struct.pack("<9f3H", 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 2)
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": 3,
                "type": "VEC3",
                "min": [0, 0, 0],
                "max": [1, 1, 0],
            },
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    path.write_bytes((struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)[: -cut or None])


def test_a_scene_is_flattened_with_its_transforms(tmp_path):
    path = tmp_path / "scene.glb"
    write_gltf(path, [{"mesh": 0, "translation": [5, 0, 0]}, {"mesh": 0, "scale": [2, 2, 2]}])
    mesh, notes = load_mesh(path)
    assert mesh.area == pytest.approx(0.5 + 2.0)
    assert mesh.vertices[:, 0].max() == pytest.approx(6.0)
    assert any("2 separate shells" in note for note in notes)


def test_a_mirrored_node_keeps_its_faces_outward(tmp_path):
    path = tmp_path / "mirror.glb"
    write_gltf(path, [{"mesh": 0, "scale": [1, 1, -1]}])
    np.testing.assert_allclose(load_mesh(path).mesh.face_normals(), [[0, 0, -1]], atol=1e-12)


def test_polygons_become_fans(tmp_path):
    corners = np.stack([np.cos([0, 1, 2, 3, 4]), np.sin([0, 1, 2, 3, 4]), np.zeros(5)], 1)
    faces, _ = triangulate(corners, np.array([0, 1, 2, 3, 4, 2, 3, 4]), np.array([5, 3]))
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [2, 3, 4]]
    path = tmp_path / "quad.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    assert len(load_mesh(path).mesh.faces) == 2
    path = tmp_path / "quad.off"
    path.write_text(
        "COFF # colours\n4 1 0\n0 0 0 255 0 0 255\n1 0 0 1 1 1 1\n"
        "1 1 0 1 1 1 1\n0 1 0 1 1 1 1\n4 0 1 2 3 9 9 9\n"
    )
    assert load_mesh(path).mesh.area == pytest.approx(1.0)


def test_tetrahedra_give_their_boundary(tmp_path):
    path = tmp_path / "two.mesh"
    path.write_text(
        "MeshVersionFormatted 1\nDimension 3\nVertices\n5\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 1 1 0\n"
        "Tetrahedra\n2\n1 2 3 4 0\n2 3 4 5 0\nEnd\n"
    )
    mesh = load_mesh(path).mesh
    assert len(mesh.faces) == 6
    volume = np.einsum("fa,fa->", mesh.vertices[mesh.faces[:, 0]], mesh.face_vectors()) / 6
    assert abs(volume) == pytest.approx(1 / 6 + 1 / 3)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("empty.obj", b""),
        ("points.obj", b"v 0 0 0\nv 1 0 0\n"),
        ("words.obj", b"this is no mesh\n"),
        ("photo.ply", b"\x89PNG\r\n\x1a\n" + bytes(200)),
        ("zeros.stl", bytes(84)),
        ("short.off", b"OFF\n8 12 0\n0 0 0\n"),
        ("no.off", b"hello\n"),
        ("counts.off", b"OFF\n"),
        ("index.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n"),
        ("nan.off", b"OFF\n3 1 0\n0 0 0\nnan 0 0\n0 1 0\n3 0 1 2\n"),
        ("short.mesh", b"MeshVersionFormatted 1\nVertices\n9\n0 0 0 0\n"),
        ("no.mesh", b"solid"),
        ("short.glb", b"glTF\x02\0\0\0\xff\0\0\0"),
        ("text.gltf", b'{"asset":'),
        ("mesh.docx", b"PK"),
        ("noending", b"OFF"),
    ],
)
def test_bad_files_are_refused_with_the_file_named(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load_mesh(path)
    assert name in str(caught.value)


def test_truncated_files_are_refused(tmp_path):
    path = tmp_path / "cut.glb"
    write_gltf(path, [{"mesh": 0}], cut=12)
    with pytest.raises(InputError, match=r"cut\.glb"):
        load_mesh(path)
    for suffix in (".stl", ".ply"):
        path = tmp_path / f"cut{suffix}"
        save_mesh(TETRAHEDRON, path)
        path.write_bytes(path.read_bytes()[:-30])
        with pytest.raises(InputError, match=f"cut{suffix}"):
            load_mesh(path)


def test_missing_files_and_folders_are_reported(tmp_path):
    with pytest.raises(InputError, match="the file does not exist"):
        load_mesh(tmp_path / "nowhere.obj")
    with pytest.raises(InputError, match="folder"):
        load_mesh(tmp_path)


def test_unwritable_mesh_is_refused(tmp_path):
    with pytest.raises(InputError, match="Known"):
        save_mesh(TETRAHEDRON, tmp_path / "mesh.docx")
    with pytest.raises(ResourceError):
        save_mesh(TETRAHEDRON, tmp_path / "no" / "such" / "folder.obj")


@pytest.mark.parametrize("coloured", [False, True])
def test_glb_declares_buffer_targets(tmp_path, coloured):
    """With declared targets, Khronos' validator reports no error, warning or hint."""
    colours = np.full((len(TETRAHEDRON.vertices), 3), 90, np.uint8) if coloured else None
    save_mesh(Mesh(TETRAHEDRON.vertices, TETRAHEDRON.faces, colours=colours), tmp_path / "made.glb")
    data = (tmp_path / "made.glb").read_bytes()
    document = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    (part,) = document["meshes"][0]["primitives"]
    target = [
        document["bufferViews"][accessor["bufferView"]].get("target") for accessor in document["accessors"]
    ]
    assert target[part["indices"]] == 34963 and set(part["attributes"]) >= {"POSITION"}
    assert ("COLOR_0" in part["attributes"]) == coloured
    assert {target[number] for number in part["attributes"].values()} == {34962}


def test_the_colour_of_a_gltf_material_is_linear_light(tmp_path):
    import trimesh

    box = trimesh.creation.box()
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[55, 0, 255, 255])
    box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(box.vertices), 2)), material=material)
    path = tmp_path / "box.glb"
    box.export(path)
    colours = load_mesh(path).mesh.colours
    assert colours is not None
    np.testing.assert_allclose(colours[0].astype(int), [128, 0, 255], atol=1)


@pytest.mark.parametrize("high", [0.3, 1.0, 3.0])
def test_a_mesh_that_lies_down_is_turned_and_one_that_may_is_asked_about(tmp_path, high):
    """The test mesh is a tetrahedron that stands on the floor above the origin, written with each of the up
    axes.
    """
    standing = Mesh((TETRAHEDRON.vertices - [0.25, 0, 0.25]) * [1, high, 1], TETRAHEDRON.faces)
    lying = Mesh(standing.vertices[:, [0, 2, 1]] * [1, -1, 1], standing.faces)
    for name, mesh, note in (("standing", standing, ""), ("lying", lying, "--up y")):
        save_mesh(mesh, tmp_path / f"{name}.off")
        read, notes = load_upright(tmp_path / f"{name}.off")
        np.testing.assert_allclose(read.vertices, standing.vertices, atol=1e-6)
        assert note in " ".join(notes) and bool(notes) == bool(note)
    kept, notes = load_upright(tmp_path / "lying.off", "y")
    np.testing.assert_allclose(kept.vertices, lying.vertices, atol=1e-6)
    save_mesh(lying, tmp_path / "lying.glb")
    assert np.ptp(load_upright(tmp_path / "lying.glb").mesh.vertices[:, 1]) == pytest.approx(1.0), "+Y is up"
    flat = Mesh((standing.vertices + 1) * [1, 0.05, 1], standing.faces)
    save_mesh(flat, tmp_path / "flat.off")
    assert "times longer than high" in " ".join(load_upright(tmp_path / "flat.off").notes)


def test_colours_of_a_glb_are_linear_light_and_come_back_as_they_were(tmp_path):
    """COLOR_0 is linear (glTF 2.0, 3.7.2.1): sRGB 188 is half of the light, 128 a fifth."""
    shades = np.array([0, 1, 7, 55, 128, 188, 254, 255], np.uint8)
    vertices = np.concatenate([TETRAHEDRON.vertices, TETRAHEDRON.vertices + 3.0])
    faces = np.concatenate([TETRAHEDRON.faces, TETRAHEDRON.faces + 4])
    mesh = Mesh(vertices, faces, "c", np.stack([shades, shades[::-1], shades], 1))
    path = tmp_path / "c.glb"
    save_mesh(mesh, path)
    data = path.read_bytes()
    length = struct.unpack("<I", data[12:16])[0]
    document = json.loads(data[20 : 20 + length])
    accessor = document["accessors"][document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]]
    start = document["bufferViews"][accessor["bufferView"]]["byteOffset"] + 28 + length
    stored = np.frombuffer(data, np.uint16, 4 * len(shades), start).reshape(-1, 4) / 65535
    assert accessor["componentType"] == 5123 and accessor["normalized"]
    # Computed by hand: 128 -> ((128/255 + 0.055) / 1.055) ** 2.4 = 0.215861, 55 -> 0.038204, 7 ->
    # 7/255/12.92.
    by_hand = [0.0, 0.000304, 0.002125, 0.038204, 0.215861, 0.502886, 0.991102, 1.0]
    np.testing.assert_allclose(stored[:, 0], by_hand, atol=2e-5)
    assert (stored[:, 3] == 1.0).all()
    np.testing.assert_array_equal(load_mesh(path).mesh.colours, mesh.colours)
    save_mesh(load_mesh(path).mesh, tmp_path / "again.glb")
    np.testing.assert_array_equal(load_mesh(tmp_path / "again.glb").mesh.colours, mesh.colours)
