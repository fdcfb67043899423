"""Measures a frame of the window: ten textured characters of 20,000 vertices in new poses, at 1280 x 720."""

from __future__ import annotations

import io
import json
import time
from collections.abc import Iterator

import numpy as np
from figure import Figure
from PIL import Image

from enliven.document import Character, Pose, SkinWeights
from enliven.meshes import MeshMaterials, Texture
from enliven_viewer.render.camera import OrbitCamera
from enliven_viewer.render.gl.context import create_offscreen_context
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import PLAIN, Scene, SceneCharacter

CHARACTERS = 10
ROWS, COLUMNS = 125, 160
"""Rows and columns of a character's vertices: 20,000 in all."""
BONES = 24
SIZE = (1280, 720)
FRAMES = 60
TEXTURE = 1024


def figures() -> Iterator[Figure]:
    """Yields window.frame_ms_10x20k, its 99th percentile, and its processor time in milliseconds."""
    ctx = create_offscreen_context()
    renderer = Renderer(ctx, SIZE)
    texture = _make_texture()
    crowd = [_make_character(f"tube {k}", k, texture) for k in range(CHARACTERS)]
    camera = OrbitCamera()
    box = np.array([-2.9, 0.0, -1.2]), np.array([2.9, 1.8, 1.2])
    camera.frame(box, SIZE[0] / SIZE[1], at_once=True)
    wall, busy = [], []
    for frame in range(FRAMES + 3):
        actors = tuple(
            SceneCharacter(character, _make_pose(character, frame / 30 + k))
            for k, character in enumerate(crowd)
        )
        began, before = time.perf_counter(), time.process_time()
        renderer.draw(Scene(actors, (), PLAIN, extent=box), camera.view(SIZE[0] / SIZE[1]))
        ctx.finish()
        wall.append(1e3 * (time.perf_counter() - began))
        busy.append(1e3 * (time.process_time() - before))
    yield Figure("window.frame_ms_10x20k", float(np.median(wall[3:])), "ms")
    yield Figure("window.frame_p99_ms_10x20k", float(np.percentile(wall[3:], 99)), "ms")
    yield Figure("window.frame_cpu_ms_10x20k", float(np.median(busy[3:])), "ms")


def _make_texture() -> Texture:
    """Returns stripes and grain, so that every texel differs."""
    dice = np.random.default_rng(1)
    across = np.linspace(0, 40, TEXTURE)
    stripes = 128 + 90 * np.sin(across)[:, None] * np.cos(across)[None]
    pixels = np.stack([stripes, 0.7 * stripes, 255 - stripes], -1) + dice.normal(0, 8, (TEXTURE, TEXTURE, 3))
    data = io.BytesIO()
    Image.fromarray(np.clip(pixels, 0, 255).astype(np.uint8)).save(data, "PNG", compress_level=1)
    return Texture(np.frombuffer(data.getvalue(), np.uint8))


def _make_character(name: str, number: int, texture: Texture) -> Character:
    """Returns a bumpy tube of a person's height with a chain of bones."""
    height, around = np.meshgrid(np.linspace(0, 1, ROWS), np.linspace(0, 2 * np.pi, COLUMNS), indexing="ij")
    radius = 0.2 * np.sin(np.pi * (0.04 + 0.92 * height)) * (1 + 0.12 * np.sin(5 * around + 9 * height))
    place = np.array([(number % 5 - 2) * 1.2, 0.05, (number // 5) * 1.4 - 0.7])
    vertices = np.stack([radius * np.cos(around), 1.7 * height, -radius * np.sin(around)], -1) + place
    a = (np.arange(ROWS - 1)[:, None] * COLUMNS + np.arange(COLUMNS - 1)).ravel()
    faces = np.concatenate(
        [np.stack([a, a + 1, a + COLUMNS], 1), np.stack([a + 1, a + COLUMNS + 1, a + COLUMNS], 1)]
    )
    at = height.ravel() * (BONES - 1.001)
    first, share = at.astype(int), at % 1
    indices = np.zeros((ROWS * COLUMNS, 4), np.uint16)
    weights = np.zeros((ROWS * COLUMNS, 4), np.float32)
    indices[:, 0], indices[:, 1] = first, first + 1
    weights[:, 0], weights[:, 1] = 1 - share, share
    pivots = place + np.linspace([0, 0, 0], [0, 1.7, 0], BONES)
    uv = np.stack([around / np.pi, 2 * height], -1).reshape(-1, 1, 2).astype(np.float32)
    definition = json.dumps(
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.1}}
    )
    materials = MeshMaterials((definition,), (texture,), np.zeros(len(faces), np.int32), uv[faces])
    skin, edges = SkinWeights(indices, weights), np.zeros((0, 2), np.int32)
    return Character(
        name,
        vertices.reshape(-1, 3).astype(np.float32),
        faces.astype(np.int32),
        skin,
        pivots.astype(np.float32),
        edges,
        "bones",
        materials=materials,
    )


def _make_pose(one: Character, second: float) -> Pose:
    """Returns a pose in which the chain sways."""
    bend = 0.25 * np.sin(2 * second) * np.linspace(0, 1, BONES)
    c, s, zero = np.cos(bend), np.sin(bend), np.zeros(BONES)
    linear = np.stack([c, -s, zero, s, c, zero, zero, zero, zero + 1], -1).reshape(-1, 3, 3)
    moved = one.pivots + np.stack([-0.3 * bend, zero, zero], -1)
    return Pose(one.id, 0, linear.astype(np.float32), moved.astype(np.float32))
