"""Tests that materials and textures of a GLB keep their fields and bytes in a project, its file and an
export.
"""

import io
import json
import struct

import numpy as np
import pytest
from gltf_builder import GltfBuilder
from PIL import Image
from strict_gltf import checked_glb

from enliven.document import Project, are_identical
from enliven.example_sessions.mesh import load_session_mesh
from enliven.example_sessions.tables import MeshTable
from enliven.exporters import sample_performance
from enliven.exporters.gltf.write import build_glb, write_gltf
from enliven.formats.gltf.read import read_gltf
from enliven.formats.project.file import read_project, write_project

PARTS = np.array([[0, 1, 2], [0, 2, 3]])


def picture(kind, seed):
    pixels = np.random.default_rng(seed).integers(0, 255, (5, 7, 3)).astype(np.uint8)
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, kind)
    return out.getvalue()


WOOD, BUMPS = picture("PNG", 0), picture("JPEG", 1)
OAK = {
    "name": "oak",
    "pbrMetallicRoughness": {
        "baseColorFactor": [0.9, 0.8, 0.7, 1.0],
        "baseColorTexture": {
            "index": 1,
            "extensions": {"KHR_texture_transform": {"scale": [2.0, 3.0]}},
        },
        "metallicRoughnessTexture": {"index": 0, "texCoord": 1},
        "metallicFactor": 0.25,
    },
    "normalTexture": {"index": 0, "scale": 0.5},
    "emissiveTexture": {"index": 1},
    "emissiveFactor": [0.1, 0.2, 0.3],
    "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}},
    "doubleSided": True,
}
GLASS = {
    "name": "glass",
    "alphaMode": "MASK",
    "alphaCutoff": 0.3,
    "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 0.5], "roughnessFactor": 0.1},
}


def made_file(path, wood=WOOD, materials=(OAK, GLASS)):
    """Writes a square with two materials and a triangle without one. The textured material uses two sets of
    coordinates.
    """
    random, gltf = np.random.default_rng(5), GltfBuilder()
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    place = gltf.accessor(corners)
    uvs = random.uniform(-2, 3, (2, 4, 2)).astype(np.float32)
    tints = random.uniform(0, 1, (4, 3)).astype(np.float32)
    both = {"TEXCOORD_0": gltf.accessor(uvs[0]), "TEXCOORD_1": gltf.accessor(uvs[1])}
    faces = [gltf.accessor(PARTS[k].astype(np.uint16)) for k in range(2)]
    lone = gltf.accessor(np.eye(3, dtype=np.float32) + 2)
    primitives = [
        {"attributes": {"POSITION": place, **both}, "indices": faces[0], "material": 0},
        {
            "attributes": {"POSITION": place, "COLOR_0": gltf.accessor(tints)},
            "indices": faces[1],
            "material": 1,
        },
        {"attributes": {"POSITION": lone}},
    ]
    gltf.add("meshes", {"primitives": primitives})
    gltf.node(mesh=0, name="square")
    for data, kind in ((wood, "image/png"), (BUMPS, "image/jpeg")):
        gltf.add("images", {"bufferView": gltf.view(data), "mimeType": kind})
    gltf.add("samplers", {"wrapS": 33071, "magFilter": 9728})
    gltf.json["textures"] = [{"source": 1}, {"source": 0, "sampler": 0}]
    gltf.json["materials"] = list(materials)
    gltf.json["extensionsUsed"] = ["KHR_texture_transform", "KHR_materials_emissive_strength"]
    gltf.write(path)
    return uvs, tints


def opened(data):
    """Returns the JSON of a GLB, and a function that returns the bytes of one of its images."""
    (length,) = struct.unpack_from("<I", data, 12)
    document, blob = json.loads(data[20 : 20 + length]), data[28 + length :]

    def image(number):
        view = document["bufferViews"][document["images"][number]["bufferView"]]
        start = view.get("byteOffset", 0)
        return blob[start : start + view["byteLength"]]

    return document, image


def resolved(material, document, image):
    """Returns a material in which texture indices are replaced by images and samplers."""
    if isinstance(material, list):
        return [resolved(inner, document, image) for inner in material]
    if not isinstance(material, dict):
        return material
    copied = {key: resolved(inner, document, image) for key, inner in material.items()}
    for key, inner in copied.items():
        if key.endswith("Texture"):
            texture = document["textures"][inner["index"]]
            sampler = texture.get("sampler")
            sampler_table = None if sampler is None else document["samplers"][sampler]
            inner["index"] = (image(texture["source"]), sampler_table)
    return copied


def expected(material):
    sampler = {"wrapS": 33071, "magFilter": 9728}
    fake = {"textures": [{"source": 1}, {"source": 0, "sampler": 0}], "samplers": [sampler]}
    return resolved(material, fake, [WOOD, BUMPS].__getitem__)


@pytest.mark.parametrize("weld", [False, True])
def test_materials_and_images_are_the_same_after_project_file_and_export(tmp_path, weld):
    uvs, tints = made_file(tmp_path / "square.gltf")
    rig = read_gltf(tmp_path / "square.gltf", weld=weld)
    project = Project().with_characters(rig.shape)
    write_project(tmp_path / "square.enliven", project)
    again = read_project(tmp_path / "square.enliven")
    assert are_identical(again, project)
    data = build_glb([sample_performance(again, rig.shape.id)])
    checked_glb(data)
    document, image = opened(data)
    by_name = {material["name"]: material for material in document["materials"]}
    for material in (OAK, GLASS):
        assert resolved(by_name[material["name"]], document, image) == expected(material)
    assert document["extensionsUsed"] == ["KHR_materials_emissive_strength", "KHR_texture_transform"]
    assert len(document["images"]) == 2 and {i["mimeType"] for i in document["images"]} == {
        "image/png",
        "image/jpeg",
    }
    (tmp_path / "out.glb").write_bytes(data)
    back = read_gltf(tmp_path / "out.glb").shape.mesh
    corners = back.vertices[back.faces]
    numbers = [json.loads(m)["name"] for m in back.materials.definitions]
    flat = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    for face, name in enumerate(numbers[n] for n in back.materials.of):
        for corner in range(3):
            at = np.flatnonzero((np.abs(flat - corners[face, corner]) < 1e-6).all(1))
            if name == "oak":
                np.testing.assert_array_equal(back.materials.uvs[face, corner], uvs[:, at[0]])
            elif name == "glass":
                np.testing.assert_array_equal(back.materials.tints[face, corner], [*tints[at[0]], 1.0])
            else:
                assert not len(at), "the lone triangle shows its colours by a plain material"


def test_a_file_that_is_read_and_written_again_and_again_stays_the_same(tmp_path):
    made_file(tmp_path / "0.gltf")
    turns = []
    for turn in range(3):
        rig = read_gltf(sorted(tmp_path.glob(f"{turn}.gl*"))[0], name="square")
        project = Project().with_characters(rig.shape)
        write_gltf(tmp_path / f"{turn + 1}.glb", [sample_performance(project, "square")])
        turns.append(read_gltf(tmp_path / f"{turn + 1}.glb").shape.mesh.materials)
    assert are_identical(turns[1], turns[2])
    assert turns[0].definitions == turns[1].definitions and are_identical(
        turns[0].textures, turns[1].textures
    )


def test_two_characters_with_one_material_share_it(tmp_path):
    made_file(tmp_path / "square.gltf")
    shapes = [read_gltf(tmp_path / "square.gltf", name=name).shape for name in ("one", "two")]
    project = Project().with_characters(*shapes)
    document, _ = opened(build_glb([sample_performance(project, name) for name in ("one", "two")]))
    assert [material["name"] for material in document["materials"]] == ["oak", "glass", "one", "two"]
    assert len(document["images"]) == 2 and len(document["textures"]) == 2


@pytest.mark.parametrize(
    ("wood", "materials", "said"),
    [
        (
            b"GIF89a" + bytes(40),
            (OAK, GLASS),
            "texture 1 is ignored (a texture is neither a PNG nor a JPEG image)",
        ),
        (WOOD, ({**OAK, "normalTexture": {"index": 9}}, GLASS), "texture 9 is ignored"),
        (WOOD, ({**OAK, "normalTexture": {"index": "0"}}, GLASS), "material 0 cannot be read"),
        (WOOD, ({**OAK, "emissiveFactor": [float("nan")]}, GLASS), "material 0 cannot be read"),
        (WOOD, ({**OAK, "normalTexture": {"index": -1}}, GLASS), "is ignored"),
    ],
)
def test_a_damaged_material_is_left_out_with_a_note(tmp_path, wood, materials, said):
    made_file(tmp_path / "square.gltf", wood, materials)
    rig = read_gltf(tmp_path / "square.gltf")
    assert any(said in note for note in rig.notes)
    document, image = opened(
        build_glb([sample_performance(Project().with_characters(rig.shape), rig.shape.id)])
    )
    by_name = {material["name"]: material for material in document["materials"]}
    assert resolved(by_name["glass"], document, image) == expected(GLASS)


def test_a_session_has_the_materials_of_its_mesh(tmp_path):
    made_file(tmp_path / "square.gltf")
    mesh = load_session_mesh(MeshTable("square.gltf"), tmp_path / "square.gltf").mesh
    own = read_gltf(tmp_path / "square.gltf").shape.mesh
    assert are_identical(mesh.materials, own.materials) and len(mesh.faces) == len(own.faces)


def test_images_outside_of_the_folder_are_not_taken(tmp_path):
    (tmp_path / "secret.png").write_bytes(WOOD)
    inner = tmp_path / "model"
    inner.mkdir()
    made_file(inner / "square.gltf")
    document = json.loads((inner / "square.gltf").read_text())
    document["images"][0] = {"uri": "../secret.png"}
    (inner / "square.gltf").write_text(json.dumps(document))
    rig = read_gltf(inner / "square.gltf")
    assert any("outside of the folder of the model" in note for note in rig.notes)
    assert WOOD not in build_glb([sample_performance(Project().with_characters(rig.shape), rig.shape.id)])
