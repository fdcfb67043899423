"""Tests that cuts, unions and refinements keep the faces' materials and the corners' texture coordinates."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mesh_makers import ball, flat_shaded, line, on_bone, random_skin, tube

from enliven.document import Project
from enliven.document.rigged import still_shape
from enliven.errors import InputError
from enliven.exporters import sample_performance
from enliven.exporters.gltf.write import write_gltf
from enliven.formats.gltf.read import read_gltf
from enliven.meshes import MeshMaterials, Texture, extract_submesh, join_materials, refine
from enliven.modeling.edits import mirror_character
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.modeling.mesh.mesh_cut import cut_by_stroke
from enliven.modeling.mesh.mesh_union import unite_meshes
from enliven.modeling.rigged.cutting import cut_bone
from enliven.modeling.rigged.merging import merge
from enliven.modeling.skinning.heat_diffusion import bone_heat

PNG = b"\x89PNG\r\n\x1a\n"
"""The first bytes of every PNG file. No test decodes the rest."""
CLOSE = 1e-6
"""Tolerance of a texture coordinate, as a fraction of the width: single precision and one interpolation."""


def clothed(mesh, seed, names=("a", "b")):
    """Returns the mesh with two textured materials, left and right, and the maps by the materials' names.

    Each material has an affine map from positions to texture coordinates, and one to vertex tints.
    """
    random = np.random.default_rng(seed)
    maps = {name: random.uniform(-1, 1, (4, 2 * 2 + 4)) for name in names}
    of = (mesh.vertices[mesh.faces].mean(1)[:, 0] > 0).astype(np.int32)
    corners = np.concatenate([mesh.vertices[mesh.faces], np.ones((len(mesh.faces), 3, 1))], 2)
    values = np.einsum("fka,fab->fkb", corners, np.array([maps[name] for name in names])[of])
    textures = tuple(Texture(np.frombuffer(PNG + name.encode(), np.uint8)) for name in names)
    definitions = (json.dumps({"name": n, "emissiveTexture": {"index": k}}) for k, n in enumerate(names))
    uvs = values[..., :4].reshape(-1, 3, 2, 2).astype(np.float32)
    materials = MeshMaterials(tuple(definitions), textures, of, uvs, values[..., 4:].astype(np.float32))
    return type(mesh)(mesh.vertices, mesh.faces, mesh.name, None, materials), maps


def check(mesh, maps):
    """Checks that every corner has the texture coordinates of its material's map. Returns (F,) material
    names, or "".
    """
    own = mesh.materials
    names = [json.loads(definition)["name"] for definition in own.definitions]
    for name, definition in zip(names, own.definitions, strict=True):
        texture = own.textures[json.loads(definition)["emissiveTexture"]["index"]]
        assert texture.image.tobytes() == PNG + name.encode()
    for number, name in enumerate(names):
        faces = own.of == number
        places = mesh.vertices[mesh.faces[faces]]
        expected = np.concatenate([places, np.ones((*places.shape[:2], 1))], 2) @ maps[name]
        corners = np.concatenate([own.uvs[faces].reshape(-1, 3, 4), own.tints[faces]], 2)
        np.testing.assert_allclose(corners, expected, atol=CLOSE)
    return np.array([*names, ""])[own.of]


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000), st.tuples(*[st.floats(-1, 1)] * 3), st.floats(-0.06, 0.06), st.booleans())
def test_both_sides_of_a_cut_keep_them(seed, way, off, flat):
    mesh, maps = clothed(flat_shaded(ball(0.1)) if flat else ball(0.1), seed)
    normal = np.array(way) + np.array([0, 1e-2, 0])
    normal /= np.linalg.norm(normal)
    cut = cut_by_stroke(mesh, random_skin(len(mesh.vertices), 3), PlaneCut(off * normal, normal))
    for piece in (cut.near, cut.far):
        named = check(piece.mesh, maps)
        closing = np.arange(len(named)) >= len(named) - piece.caps
        np.testing.assert_array_equal(named == "", closing)
        sides = piece.mesh.vertices[piece.mesh.faces].mean(1)[:, 0] > 0
        pure = np.abs(piece.mesh.vertices[piece.mesh.faces][..., 0]).min(1) > 0.03
        assert (named[pure & sides & (named != "")] == "b").all()
        assert (named[pure & ~sides & (named != "")] == "a").all()


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000), st.tuples(*[st.floats(-1, 1)] * 3), st.floats(0.06, 0.14), st.booleans())
def test_a_union_keeps_those_of_both(seed, way, far, flat):
    way = np.array(way) + np.array([0, 0, 1e-3])
    first, maps = clothed(ball(0.1), seed)
    second, more = clothed(ball(0.06, far * way / np.linalg.norm(way)), seed + 1, ("c", "d"))
    if flat:
        first, second = (type(m)(*flat_parts(m)) for m in (first, second))
    skins = random_skin(len(first.vertices), 2, 1), random_skin(len(second.vertices), 2, 2)
    union = unite_meshes(first, skins[0], second, skins[1], offset=2)
    named = check(union.mesh, {**maps, **more})
    assert (named != "").all()
    middle = union.mesh.vertices[union.mesh.faces].mean(1)
    outside = np.linalg.norm(middle, axis=1) > 0.102
    assert np.isin(named[outside], ["c", "d"]).all()


def flat_parts(mesh):
    flat = flat_shaded(mesh)
    return flat.vertices, flat.faces, flat.name, None, mesh.materials


def test_a_tidied_seam_keeps_them_nearly(seed=3):
    first, maps = clothed(tube(), seed)
    second, more = clothed(tube(radius=0.15, length=1.0), seed + 1, ("c", "d"))
    turned = second.vertices[:, [1, 0, 2]] * [1, 1, -1] + [0.0, 0.3, 0.02]
    moved = type(second)(turned, second.faces, "other", None, second.materials)
    skins = on_bone(first, 1), on_bone(moved, 1)
    rough, tidy = (unite_meshes(first, skins[0], moved, skins[1], tidy=tidy) for tidy in (False, True))
    assert len(tidy.mesh.faces) < len(rough.mesh.faces)
    own, maps_of = tidy.mesh.materials, {**maps, **more}
    names = [json.loads(definition)["name"] for definition in own.definitions]
    off = []
    for face, number in enumerate(own.of):
        places = tidy.mesh.vertices[tidy.mesh.faces[face]]
        if names[number] in "cd":
            places = (places - [0.0, 0.3, 0.02]) * [1, 1, -1]
            places = places[:, [1, 0, 2]]
        expected = np.concatenate([places, np.ones((3, 1))], 1) @ maps_of[names[number]]
        off.append(np.abs(own.uvs[face].reshape(3, 4) - expected[:, :4]).max())
    assert np.median(off) < CLOSE and max(off) < 0.1, "only slivers' faces are off, by less than a face"


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 1000), st.floats(0.01, 0.05))
def test_refinement_and_a_part_keep_them(seed, longest):
    mesh, maps = clothed(ball(0.1, detail=2), seed)
    fine = refine(mesh, longest)
    assert (check(fine, maps) != "").all()
    check(extract_submesh(fine, np.arange(len(fine.faces)) % 3 > 0), maps)


def test_the_corners_of_a_mirrored_shape_have_the_places_in_textures_that_they_had():
    mesh, _ = clothed(tube(), 0)
    shape = still_shape("tube", line([[0, -1, 0], [0, 0, 0], [0, 1, 0]]), mesh, on_bone(mesh, 1))
    mirrored = mirror_character(Project().with_characters(shape), "tube", [1, 0, 0]).characters["tube"].mesh
    np.testing.assert_array_equal(mirrored.materials.uvs, mesh.materials.uvs[:, ::-1])
    np.testing.assert_array_equal(mirrored.faces, mesh.faces[:, ::-1])


def test_a_shape_that_is_cut_and_merged_is_exported_with_them(tmp_path):
    mesh, maps = clothed(tube(), 7)
    skeleton = line([[0, 0, 0.0], [0, 0, 0.7], [0, 0, 1.3], [0, 0, 2.0]])
    shape = still_shape("tube", skeleton, mesh, bone_heat(mesh, skeleton))
    project, (near, far) = cut_bone(Project().with_characters(shape), "tube", 2, 0.5)
    joint = len(project.shape(near).skeleton) - 1
    project, _ = merge(project, near, joint, far)
    write_gltf(tmp_path / "tube.glb", [sample_performance(project, near)])
    back = read_gltf(tmp_path / "tube.glb").shape.mesh
    names = [json.loads(definition)["name"] for definition in back.materials.definitions]
    still = 0
    for face, number in enumerate(back.materials.of):
        places = back.vertices[back.faces[face]]
        if names[number] in maps and (np.abs(places[:, 2] - 1.0) > 0.3).all():
            expected = np.concatenate([places, np.ones((3, 1))], 1) @ maps[names[number]]
            np.testing.assert_allclose(back.materials.uvs[face].reshape(3, 4), expected[:, :4], atol=CLOSE)
            still += 1
    assert {"a", "b"} <= set(names) and still > 0.5 * len(mesh.faces)


def test_equal_materials_become_one_and_bare_faces_have_none():
    clothed_mesh, _ = clothed(ball(0.1, detail=1), 0)
    count = len(clothed_mesh.faces)
    both = join_materials([(clothed_mesh.materials, count), (None, 2), (clothed_mesh.materials, count)])
    assert len(both.definitions) == len(both.textures) == 2 and (both.of[count : count + 2] == -1).all()
    np.testing.assert_array_equal(both.of[:count], both.of[count + 2 :])
    assert join_materials([(None, 3), (None, 1)]) is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"of": np.array([2], np.int32)}, "material outside"),
        ({"uvs": np.zeros((1, 3, 2), np.float32)}, "texture coordinates have the shape"),
        ({"tints": np.zeros((2, 3, 4), np.float32)}, "corner colours have the shape"),
        ({"definitions": ('{"normalTexture": {"index": 1}}',)}, "refers to texture 1, but only 0 textures"),
        ({"definitions": ('{"normalTexture": {"index": true}}',)}, "does not contain a texture number"),
        ({"definitions": ("[1]",)}, "not a JSON object"),
        ({"definitions": ('{"emissiveFactor": [NaN]}',)}, "not a JSON object"),
        ({"uvs": np.full((1, 3, 1, 2), np.nan, np.float32)}, "not a finite number"),
        ({"definitions": ("[" * 100_000,)}, "not a JSON object"),
    ],
)
def test_inconsistent_materials_are_refused(change, said):
    with pytest.raises(InputError, match="neither a PNG nor a JPEG image"):
        Texture(np.frombuffer(b"GIF89a", np.uint8))
    with pytest.raises(InputError, match="not a JSON object"):
        Texture(np.frombuffer(PNG, np.uint8), "[]")
    good = {"definitions": ("{}",), "textures": (), "of": np.zeros(1, np.int32)}
    good["uvs"] = np.zeros((1, 3, 1, 2), np.float32)
    MeshMaterials(**good)
    with pytest.raises(InputError, match=said):
        MeshMaterials(**{**good, **change})
