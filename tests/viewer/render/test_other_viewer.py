"""Tests that exported files look the same in three.js and in enliven's renderer: colours, silhouettes,
poses.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from gltf_builder import GltfBuilder
from PIL import Image
from three_viewer import MISSING_REASON
from web_pictures import SIZE, compare

from enliven.cli import run
from enliven.document import Character, Project, SkinWeights, character_of
from enliven.formats.gltf.read import read_gltf
from enliven.formats.rig.rig import play_clip
from enliven.meshes import Mesh, load_mesh, save_mesh
from enliven.motion.layers.evaluate import Player

pytestmark = pytest.mark.skipif(bool(MISSING_REASON), reason=MISSING_REASON or "all is here")
PICTURES = Path(__file__).parents[3] / "out" / "web" / "pictures"
LEAST = 0.97
"""Minimum intersection over union of the silhouettes. The outline of a shape of 100 pixels may be a quarter
of a pixel off.
"""
CLOSE = 3.0
"""Maximum difference of a region's mean colour, 0..255.

Dither and rounding in enliven contribute 1. The rounding of three.js adds as much, which the steep start of
the tone curve doubles in dark colours.
"""


def sphere(rings: int = 40, around: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns vertices, faces and texture coordinates of a sphere of one metre."""
    v, u = np.meshgrid(np.linspace(0, 1, rings + 1), np.linspace(0, 1, around + 1), indexing="ij")
    up, turn = np.pi * v, 2 * np.pi * u
    points = np.stack([np.sin(up) * np.sin(turn), 1 + np.cos(up), np.sin(up) * np.cos(turn)], -1) * 0.5
    at = np.arange((rings + 1) * (around + 1)).reshape(rings + 1, around + 1)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return points.reshape(-1, 3), faces.astype(np.int32), np.stack([u, v], -1).reshape(-1, 2)


def still_character(mesh: Mesh) -> Character:
    count = len(mesh.vertices)
    skin = SkinWeights(np.zeros((count, 4), np.uint16), np.tile(np.float32([1, 0, 0, 0]), (count, 1)))
    none, pivot = np.zeros((0, 2), np.int32), np.zeros((1, 3), np.float32)
    own = mesh.vertices.astype(np.float32), mesh.faces, skin, pivot, none
    return Character(mesh.name, *own, colours=mesh.colours, materials=mesh.materials)


def keep(picture: np.ndarray, name: str) -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(PICTURES / f"{name}.png")


def test_colours_of_a_scan_are_the_same(tmp_path: Path) -> None:
    vertices, faces, _ = sphere()
    colours = (128 + 127 * np.sin(9 * vertices + [0, 2, 4])).astype(np.uint8)
    mesh = Mesh(vertices, faces, "scan", colours)
    save_mesh(mesh, tmp_path / "scan.glb")
    file = [((tmp_path / "scan.glb").read_bytes(), [None])]
    for number, own in enumerate((mesh, load_mesh(tmp_path / "scan.glb").mesh)):
        character = still_character(own)
        poses = [character.rest_pose()]
        ((comparison,),), picture = compare(character, poses, file, tmp_path / f"browser {number}")
        keep(picture, f"scan {number}")
        assert comparison.overlap > LEAST
        assert len(comparison.colours) > 40 and comparison.colours.max() < CLOSE


def chequered() -> bytes:
    """Returns an image with squares of 8 pixels in four colours. A quarter of them are holes."""
    colours = np.array([[(230, 40, 30, 255), (40, 160, 60, 255)], [(30, 60, 190, 255), (200, 190, 60, 0)]])
    pixels = np.kron(colours.astype(np.uint8), np.ones((64, 64, 1), np.uint8))
    data = io.BytesIO()
    Image.fromarray(pixels).save(data, "PNG")
    return data.getvalue()


def rigged(path: Path) -> Path:
    """Writes two textured spheres. One jumps, is rotated by cubic keys and is mirrored. The other is skinned
    to it.
    """
    gltf, (vertices, faces, uv) = GltfBuilder(), sphere(20, 30)
    picture = gltf.view(chequered())
    gltf.json["images"] = [{"bufferView": picture, "mimeType": "image/png"}]
    gltf.json["samplers"] = [{"wrapS": 33648, "wrapT": 10497}]
    gltf.json["textures"] = [{"source": 0, "sampler": 0}]
    moved = {"offset": [0.1, -0.2], "rotation": 0.6, "scale": [2.5, 1.5]}
    texture = {"index": 0, "extensions": {"KHR_texture_transform": moved}}
    gltf.json["extensionsUsed"] = ["KHR_texture_transform"]
    base = {"baseColorFactor": [0.9, 0.8, 1.0, 1.0], "metallicFactor": 0.0}
    gltf.json["materials"] = [
        {"pbrMetallicRoughness": {**base, "baseColorTexture": texture}, "doubleSided": True},
        {
            "pbrMetallicRoughness": {**base, "baseColorTexture": {"index": 0}},
            "alphaMode": "MASK",
            "alphaCutoff": 0.4,
            "doubleSided": True,
        },
    ]
    normals = (vertices - [0, 0.5, 0]) * 2
    lower = np.linspace(0, 1, len(vertices), dtype=np.float32)
    weights = np.stack([1 - lower, lower, 0 * lower, 0 * lower], 1).astype(np.float32)
    joints = np.tile(np.uint8([0, 1, 0, 0]), (len(vertices), 1))
    shared = {
        "POSITION": gltf.accessor(vertices.astype(np.float32)),
        "NORMAL": gltf.accessor(normals.astype(np.float32)),
        "TEXCOORD_0": gltf.accessor(uv.astype(np.float32)),
    }
    corner = {"indices": gltf.accessor(faces.reshape(-1).astype(np.uint16))}
    tint = np.column_stack([0.3 + 0.7 * uv, np.ones((len(uv), 2))]).astype(np.float32)
    stiff = {"attributes": {**shared, "COLOR_0": gltf.accessor(tint)}, "material": 0, **corner}
    soft = {**shared, "JOINTS_0": gltf.accessor(joints), "WEIGHTS_0": gltf.accessor(weights)}
    gltf.add("meshes", {"primitives": [stiff]})
    gltf.add("meshes", {"primitives": [{"attributes": soft, "material": 1, **corner}]})
    hips = gltf.node(name="hips", translation=[0.0, 1.2, 0.0])
    arm = gltf.node(hips, name="arm", translation=[0.0, -0.6, 0.0])
    gltf.node(hips, name="head", mesh=0, translation=[0.4, 0.2, 0.0], scale=[-0.7, 0.7, 0.7])
    bind = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    bind[:, 3, 1] = -1.2, -0.6
    gltf.add("skins", {"joints": [hips, arm], "inverseBindMatrices": gltf.accessor(bind.reshape(2, 16))})
    gltf.node(name="body", mesh=1, skin=0, translation=[0.0, 0.0, 0.0])
    channels = [
        (hips, "translation", "STEP", [[0, 1.2, 0], [0.5, 1.5, 0], [-0.4, 1.1, 0.2]]),
        (arm, "rotation", "CUBICSPLINE", cubic()),
        (hips, "rotation", "LINEAR", [[0, 0, 0, 1], [0, 0.6, 0, 0.8], [0, 0, 0.3826834, 0.9238795]]),
    ]
    times = gltf.accessor(np.array([0.0, 0.5, 1.3], np.float32))
    animation = {"channels": [], "samplers": []}
    for node, way, how, values in channels:
        output = gltf.accessor(np.array(values, np.float32))
        animation["samplers"].append({"input": times, "output": output, "interpolation": how})
        sampler = len(animation["samplers"]) - 1
        animation["channels"].append({"sampler": sampler, "target": {"node": node, "path": way}})
    gltf.add("animations", animation)
    return gltf.write(path)


def cubic() -> list[list[float]]:
    """Returns rotations about the x axis with tangents that overshoot."""
    keys = [[0, 0, 0, 1], [0.5, 0, 0, 0.8660254], [-0.3826834, 0, 0, 0.9238795]]
    slopes = [[3.0, 0, 0, 0], [-4.0, 0, 1.0, 0], [2.0, 0, 0, 0]]
    return [row for key, slope in zip(keys, slopes, strict=True) for row in (slope, key, slope)]


def test_a_textured_rig_is_the_same_in_motion(tmp_path: Path) -> None:
    path, out = rigged(tmp_path / "made.gltf"), tmp_path / "out.glb"
    rig = read_gltf(path)
    project, shape = play_clip(Project(), rig.shape, rig.clips[0])
    assert run(["export", str(path), "-o", str(out)]) == 0
    player, times = Player(project, shape.id), [0.0, 0.21, 0.499, 0.7, 1.11, 1.3]
    poses = [player.compute_message_pose(second) for second in times]
    files = [(out.read_bytes(), times), (path.read_bytes(), times)]
    compared, picture = compare(character_of(shape), poses, files, tmp_path / "browser")
    keep(picture, "rigged")
    assert picture.shape == (3 * SIZE, len(times) * SIZE, 3)
    for comparison in [comparison for row in compared for comparison in row]:
        assert comparison.overlap > LEAST
        assert len(comparison.colours) > 8 and comparison.colours.max() < 2 * CLOSE, (
            "fields of a texture meet in a region"
        )
