"""Tests of materials and textures: the GPU against a slow reference, with holes, glass, seams and bad
input.
"""

from __future__ import annotations

import io
import json
import math
from dataclasses import replace

import moderngl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from slow_shading import developed, shaded

from enliven.document import Character, SkinWeights
from enliven.errors import InputError
from enliven.meshes import MeshMaterials, Texture
from enliven_viewer.render.camera import CameraView, look_at, make_perspective
from enliven_viewer.render.materials.material import read_material
from enliven_viewer.render.materials.paint import linear_from_srgb, paint_keys, paint_surface
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import PLAIN, Scene, SceneCharacter
from enliven_viewer.render.surface import split_creases
from enliven_viewer.settings import RenderSettings

SIZE = (64, 64)
SMALL = RenderSettings(shadow_size=64, contact_size=32, samples=1)
EYE = np.array([0.3, 1.2, 3.0])
CLOSE = 2.5 / 255
"""Tolerance between GPU and reference: rounding, half a step of dither on each side, and float32."""
PATCHES = np.array([[(200, 60, 40), (40, 160, 70)], [(60, 80, 210), (230, 220, 190)]], np.uint8)


def picture(pixels: np.ndarray, sampler: str = '{"magFilter": 9728}') -> Texture:
    data = io.BytesIO()
    Image.fromarray(pixels).save(data, "PNG")
    return Texture(np.frombuffer(data.getvalue(), np.uint8), sampler)


def board(material: dict, *textures: Texture, lean: float = 0.0, at: float = 0.0) -> Character:
    """Returns an upright square of one metre whose centre is 1 m high. It leans back, and v runs
    downwards.
    """
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    c, s = math.cos(lean), math.sin(lean)
    vertices = np.stack([corners[:, 0], 1.0 + c * corners[:, 1], at - s * corners[:, 1]], 1).astype(
        np.float32
    )
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    uv = np.stack([corners[:, 0] + 0.5, 0.5 - corners[:, 1]], 1).astype(np.float32)
    materials = MeshMaterials((json.dumps(material),), textures, np.zeros(2, np.int32), uv[faces][:, :, None])
    skin = SkinWeights(np.zeros((4, 4), np.uint16), np.eye(4, dtype=np.float32)[np.zeros(4, int)])
    none = np.zeros((0, 2), np.int32)
    name = f"board {at} {lean}"
    return Character(name, vertices, faces, skin, np.zeros((1, 3), np.float32), none, materials=materials)


def view(eye: np.ndarray = EYE) -> CameraView:
    return CameraView(eye, look_at(eye, np.array([0.0, 1.0, 0.0])), make_perspective(0.5, 1.0, 0.1, 30.0))


def drawn(gl: moderngl.Context, *boards: Character, eye: np.ndarray = EYE, of: RenderSettings = SMALL):
    renderer = Renderer(gl, SIZE, of)
    actors = tuple(SceneCharacter(character, character.rest_pose()) for character in boards)
    renderer.draw(Scene(actors, (), PLAIN), view(eye))
    return renderer.pixels() / 255


def pixel_of(point: np.ndarray) -> tuple[int, int]:
    """Returns a (3,) point's image column, and its row counted from below."""
    x, y = (view().project(point[None])[0] + 1) / 2 * SIZE
    return int(x), int(y)


def ray_to(column: int, row: int, lean: float) -> np.ndarray:
    """Returns the (3,) point of a board at a pixel's centre."""
    clip = np.array([2 * (column + 0.5) / SIZE[0] - 1, 2 * (row + 0.5) / SIZE[1] - 1, 0.5, 1.0])
    far = np.linalg.inv(view().clip_from_world) @ clip
    way, n = far[:3] / far[3] - EYE, np.array([0.0, math.sin(lean), math.cos(lean)])
    return EYE + way * ((np.array([0.0, 1.0, 0.0]) - EYE) @ n) / (way @ n)


@pytest.mark.parametrize("look", ["studio", "night", "white"])
@pytest.mark.parametrize(("metallic", "roughness"), [(0.0, 0.9), (1.0, 0.3), (0.4, 0.55)])
def test_textured_board_matches_the_slow_reference(gl, look: str, metallic: float, roughness: float) -> None:
    definition = {"baseColorTexture": {"index": 0}, "metallicFactor": metallic, "roughnessFactor": roughness}
    lean, own = 0.6, replace(SMALL, look=look)
    shown = drawn(gl, board({"pbrMetallicRoughness": definition}, picture(PATCHES), lean=lean), of=own)
    n = np.array([0.0, math.sin(lean), math.cos(lean)])
    for (row, column), colour in zip(np.ndindex(2, 2), PATCHES.reshape(-1, 3), strict=True):
        across, up = column / 2 - 0.25, 0.25 - row / 2
        near = pixel_of(np.array([across, 1 + math.cos(lean) * up, -math.sin(lean) * up]))
        point = ray_to(*near, lean)
        light = shaded(linear_from_srgb(colour), metallic, roughness, n, point, EYE, own)
        wanted = developed(light, near, SIZE)
        np.testing.assert_allclose(shown[SIZE[1] - 1 - near[1], near[0]], wanted, atol=CLOSE)


def test_metal_roughness_and_occlusion_come_from_their_textures(gl) -> None:
    numbers = np.full((1, 1, 3), (51, 128, 204), np.uint8)  # red is occlusion, green roughness, blue metallic
    texture = {"index": 0}
    definition = {"pbrMetallicRoughness": {"metallicRoughnessTexture": texture, "metallicFactor": 0.5}}
    shown = drawn(gl, board({**definition, "alphaMode": "OPAQUE"}, picture(numbers)))[32, 32]
    plain = {"pbrMetallicRoughness": {"metallicFactor": 0.4, "roughnessFactor": 128 / 255}}
    np.testing.assert_allclose(shown, drawn(gl, board(plain))[32, 32], atol=CLOSE)
    darker = drawn(gl, board({**definition, "occlusionTexture": texture}, picture(numbers)))[32, 32]
    assert (darker < shown - 0.01).all()


def test_a_normal_map_lights_as_a_board_that_leans(gl) -> None:
    lean = 0.5
    up = np.array([[[0.0, math.sin(lean), math.cos(lean)]]])  # +Y of a normal map points up in the image
    bumps = picture(np.round((up + 1) * 127.5).astype(np.uint8))
    rough = {"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0}}
    shown = drawn(gl, board({**rough, "normalTexture": {"index": 0}}, bumps))[32, 32]
    n = np.array([0.0, math.sin(lean), math.cos(lean)])
    wanted = developed(shaded(np.ones(3), 0.0, 1.0, n, ray_to(32, 31, 0.0), EYE, SMALL), (32, 31), SIZE)
    np.testing.assert_allclose(shown, wanted, atol=2 * CLOSE)  # a normal map has 127 levels
    assert abs(shown - drawn(gl, board(rough))[32, 32]).max() > 0.03


def test_holes_show_what_is_behind_and_throw_no_shadow(gl) -> None:
    half = np.zeros((2, 2, 4), np.uint8)
    half[:, 0] = 255
    definition = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "alphaMode": "MASK"}
    wall = board({"pbrMetallicRoughness": {"metallicFactor": 0.0}}, at=-1.0)
    both, nothing = drawn(gl, board(definition, picture(half)), wall), drawn(gl, wall)
    left, right = (pixel_of(np.array([x, 1.0, 0.0])) for x in (-0.3, 0.3))
    assert abs(both[32, left[0]] - nothing[32, left[0]]).max() > 0.02
    np.testing.assert_allclose(both[32, right[0]], nothing[32, right[0]], atol=CLOSE)
    dark = [shadow_of(gl, each) for each in (board(definition, picture(half)), board({}))]
    assert 0.35 * dark[1] < dark[0] < 0.65 * dark[1]


def shadow_of(gl: moderngl.Context, one: Character) -> int:
    """Returns the number of texels that a board covers in the key light's shadow map."""
    renderer = Renderer(gl, SIZE, SMALL)
    extent = one.vertices.min(0) - 0.1, one.vertices.max(0) + 0.1
    renderer.draw(Scene((SceneCharacter(one, one.rest_pose()),), (), PLAIN, extent=extent), view())
    return int((np.frombuffer(renderer._shadow.texture.read(), np.float32)[::2] < 0.98).sum())


def test_glass_lets_the_wall_through_and_the_order_of_the_boards_does_not_matter(gl) -> None:
    red = {"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.05, 0.05, 0.4]}, "alphaMode": "BLEND"}
    wall = board(
        {"pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.7, 0.1, 1], "metallicFactor": 0}}, at=-0.5
    )
    through, before = drawn(gl, board(red), wall)[32, 32], drawn(gl, wall)[32, 32]
    assert through[0] > before[0] + 0.05 and through[1] < before[1] and through[1] > 0.1
    two = board({**red, "doubleSided": True}, at=0.4)
    np.testing.assert_allclose(drawn(gl, two, board(red)), drawn(gl, board(red), two), atol=1e-9)


def test_a_one_sided_board_is_not_seen_from_behind(gl) -> None:
    behind, definition = EYE * [1, 1, -1], {"pbrMetallicRoughness": {}}
    empty = drawn(gl, eye=behind)
    single, double = (drawn(gl, board({**definition, "doubleSided": d}), eye=behind) for d in (False, True))
    assert abs(single[32, 32] - empty[32, 32]).max() < 0.15  # the board's shadow may be there
    assert abs(double[32, 32] - empty[32, 32]).max() > abs(single[32, 32] - empty[32, 32]).max() + 0.05


def test_emissive_and_unlit_materials_ignore_the_light(gl) -> None:
    dark = replace(SMALL, brightness=0.1)
    lamp = {"emissiveFactor": [1, 0, 0], "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]}}
    assert drawn(gl, board(lamp), of=dark)[32, 32, 0] > 0.7
    flat = {
        "extensions": {"KHR_materials_unlit": {}},
        "pbrMetallicRoughness": {"baseColorFactor": [0, 1, 0, 1]},
    }
    wanted = developed(np.array([0.0, 1.0, 0.0]), (32, 31), SIZE)
    np.testing.assert_allclose(drawn(gl, board(flat), of=dark)[32, 32], wanted, atol=CLOSE)


def test_a_texture_transform_and_a_mirrored_texture_move_the_picture(gl) -> None:
    moved = {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0.0]}}}
    plain, shifted = (
        drawn(gl, board({"pbrMetallicRoughness": {"baseColorTexture": t}}, picture(PATCHES)))
        for t in ({"index": 0}, moved)
    )
    left, right = (pixel_of(np.array([x, 1.2, 0.0])) for x in (-0.25, 0.25))
    row = SIZE[1] - 1 - left[1]
    assert abs(shifted[row, left[0]] - plain[row, right[0]]).max() < 0.1
    assert abs(shifted[row, left[0]] - plain[row, left[0]]).max() > 0.1
    twice = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2.0, 1.0]}}}
    folded = picture(PATCHES, '{"magFilter": 9728, "wrapS": 33648}')
    shown = drawn(gl, board({"pbrMetallicRoughness": {"baseColorTexture": twice}}, folded))
    ends = [pixel_of(np.array([x, 1.2, 0.0])) for x in (-0.38, 0.38)]
    np.testing.assert_allclose(shown[row, ends[0][0]], shown[row, ends[1][0]], atol=0.1)


def test_textures_are_shared_and_leave_with_their_last_character(gl) -> None:
    renderer, shared = Renderer(gl, SIZE, SMALL), picture(PATCHES)
    definition = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    boards = [board(definition, shared, at=z) for z in (0.0, 0.5)]
    for some in (boards, boards[:1], [board(definition, shared)], []):
        renderer.draw(Scene(tuple(SceneCharacter(b, b.rest_pose()) for b in some), (), PLAIN), view())
        assert len(renderer.textures) == bool(some)


def test_broken_texture_is_white_and_reported(gl, caplog) -> None:
    broken = Texture(np.frombuffer(b"\x89PNG\r\n\x1a\n and no more", np.uint8))
    definition = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0}}
    shown = drawn(gl, board(definition, broken))[32, 32]
    assert "cannot be read" in caplog.text
    np.testing.assert_allclose(
        shown, drawn(gl, board({"pbrMetallicRoughness": {"metallicFactor": 0.0}}))[32, 32]
    )


def test_a_seam_of_texture_coordinates_is_not_seen_in_the_light() -> None:
    around = np.linspace(0, 2 * np.pi, 17)[:-1]
    ring = np.stack([np.cos(around), np.zeros(16), np.sin(around)], 1)
    vertices = np.concatenate([ring, ring + np.eye(3)[1]]).astype(np.float32)
    k = np.arange(16)
    a, b = k, (k + 1) % 16
    faces = np.concatenate([np.stack([a, a + 16, b], 1), np.stack([b, a + 16, b + 16], 1)]).astype(np.int32)
    u = np.concatenate([np.stack([k, k, k + 1], 1), np.stack([k + 1, k, k + 1], 1)]) / 16
    uvs = np.stack([u, np.zeros_like(u)], -1)[:, :, None].astype(np.float32)
    definition = json.dumps({"emissiveTexture": {"index": 0}})
    materials = MeshMaterials((definition,), (picture(PATCHES),), np.zeros(32, np.int32), uvs)
    skin = SkinWeights(np.zeros((32, 4), np.uint16), np.eye(4, dtype=np.float32)[np.zeros(32, int)])
    none, pivots = np.zeros((0, 2), np.int32), np.zeros((1, 3), np.float32)
    tube = Character("tube", vertices, faces, skin, pivots, none, materials=materials)
    cut = split_creases(vertices, faces, keys=paint_keys(tube))
    uncut = split_creases(vertices, faces)
    assert len(cut.source) == len(uncut.source) + 2
    normal_of = dict(zip(uncut.source.tolist(), uncut.normals, strict=True))
    np.testing.assert_allclose(cut.normals, [normal_of[v] for v in cut.source.tolist()], atol=1e-6)
    np.testing.assert_allclose(paint_surface(tube, cut).rows[cut.faces][:, :, 0], u, atol=1e-6)


def test_materials_that_differ_in_numbers_are_drawn_in_one_call() -> None:
    plain_board = board({})
    definitions = tuple(json.dumps({"pbrMetallicRoughness": {"roughnessFactor": k / 9}}) for k in range(9))
    of = np.array([3, -1], np.int32)
    both = replace(plain_board, materials=replace(plain_board.materials, definitions=definitions, of=of))
    paint = paint_surface(both, split_creases(both.vertices, both.faces, keys=paint_keys(both)))
    assert sorted((start, count) for _, start, count in paint.parts) == [(0, 1), (1, 1)]
    all_named = replace(both, materials=replace(both.materials, of=np.array([3, 7], np.int32)))
    paint = paint_surface(all_named, split_creases(both.vertices, both.faces, keys=paint_keys(all_named)))
    assert [count for _, _, count in paint.parts] == [2]
    np.testing.assert_allclose(sorted(set(paint.rows[:, 9].tolist())), [3 / 9, 7 / 9], atol=1e-6)


JUNK = st.recursive(
    st.none()
    | st.booleans()
    | st.floats(allow_nan=False)
    | st.integers(-(2**70), 2**70)
    | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)
KEYS = ("pbrMetallicRoughness", "alphaMode", "alphaCutoff", "emissiveFactor", "extensions", "doubleSided")
INNER = ("baseColorFactor", "metallicFactor", "roughnessFactor", "KHR_materials_emissive_strength", "index")


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(st.dictionaries(st.sampled_from(KEYS), JUNK | st.dictionaries(st.sampled_from(INNER), JUNK)))
def test_whatever_a_stranger_writes_becomes_a_material(definition: dict) -> None:
    material = read_material(json.dumps(definition))
    numbers = np.array(
        [*material.base, material.metallic, material.roughness, *material.emissive, material.cutoff]
    )
    assert np.isfinite(numbers).all() and (numbers >= 0).all()
    assert material.alpha in ("OPAQUE", "MASK", "BLEND")


def test_a_character_refuses_materials_of_other_faces() -> None:
    plain_board = board({})
    with pytest.raises(InputError, match="faces have a material"):
        replace(plain_board, faces=plain_board.faces[:1])
