"""Provides characters and bodies for the viewer's tests."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from enliven.document.character import Character, SkinWeights
from enliven.document.rigged import RiggedCharacter, still_shape
from enliven.document.skeleton import Skeleton
from enliven.errors import ResourceError
from enliven.meshes.mesh import Mesh
from enliven.person.body import Body
from enliven.person.joints import BONES
from enliven_viewer.render.gl.context import create_offscreen_context

sys.path.insert(0, str(Path(__file__).parent))  # adds the helpers in this folder to the import path

SQUARES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def box_mesh(low: tuple[float, ...], high: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Returns (8, 3) vertices and (12, 3) faces of a box, oriented outward."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    vertices = np.array(low) + corners * (np.array(high) - np.array(low))
    faces = [f for a, b, c, d in SQUARES for f in ((a, b, c), (a, c, d))]
    return vertices.astype(np.float32), np.array(faces, np.int32)


def character_of(vertices: np.ndarray, faces: np.ndarray, nodes: int, seed: int = 0) -> Character:
    """Returns a character with random vertices as graph nodes and inverse distance weights."""
    rng = np.random.default_rng(seed)
    pivots = vertices[rng.integers(0, len(vertices), nodes)] + rng.normal(0, 0.01, (nodes, 3))
    distance = np.linalg.norm(vertices[:, None] - pivots[None], axis=2)
    nearest = np.argsort(distance, axis=1)[:, :4]
    nearest = np.pad(nearest, ((0, 0), (0, 4 - nearest.shape[1])))
    weights = 1 / (np.take_along_axis(distance, nearest, 1) + 0.05)
    weights /= weights.sum(1, keepdims=True)
    edges = np.stack([np.arange(nodes - 1), np.arange(1, nodes)], 1).astype(np.int32)
    skin = SkinWeights(nearest.astype(np.uint16), weights.astype(np.float32))
    return Character("box", vertices, faces, skin, pivots.astype(np.float32), edges)


@pytest.fixture
def box() -> Character:
    """Returns a box of half a metre's width that stands on the floor, with 6 nodes."""
    return character_of(*box_mesh((-0.25, 0.0, -0.25), (0.25, 1.0, 0.25)), nodes=6)


@pytest.fixture
def make_character() -> Callable[..., Character]:
    """Returns the function that builds a character from vertices and faces."""
    return character_of


@pytest.fixture
def make_box() -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Returns the function that builds the mesh of a box."""
    return box_mesh


@pytest.fixture
def make_body() -> Callable[..., Body]:
    """Returns the function that builds an upright body at a position, with bones of 10 cm."""

    def make(at: tuple[float, float, float] = (0.0, 1.0, 0.0), confidence: float = 1.0) -> Body:
        ways = np.random.default_rng(3).normal(0, 1, (len(BONES), 3))
        ways *= 0.2 / np.linalg.norm(ways, axis=1, keepdims=True)
        joints = np.zeros((20, 3))
        joints[0] = at
        for way, (parent, child) in zip(ways, BONES, strict=True):
            joints[child] = joints[parent] + way
        return Body(1, joints, np.full(20, confidence))

    return make


@pytest.fixture(scope="session")
def one_gl() -> Iterator[moderngl.Context]:
    """Creates an OpenGL context without a window."""
    try:
        ctx = create_offscreen_context()
    except ResourceError as error:
        pytest.skip(f"no OpenGL here: {error}")
    yield ctx
    ctx.release()


@pytest.fixture(scope="module")
def gl(one_gl) -> Iterator[moderngl.Context]:
    """Makes the context current again, because another module may have made its own context current."""
    with one_gl:
        yield one_gl


@pytest.fixture
def make_limb() -> Callable[..., RiggedCharacter]:
    """Returns a closed square tube along +Y with a chain of bones and rigid skin weights."""

    def make(
        name: str = "limb", bones: int = 4, length: float = 1.0, at: tuple[float, ...] = (0.0, 0.2, 0.0)
    ) -> RiggedCharacter:
        heights = np.linspace(0.0, length, bones + 1)
        rings = np.linspace(0.0, length, 4 * bones + 1)
        square = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * 0.06
        places = [[x, y, z] for y in rings for x, z in square]
        sides = [
            f
            for ring in range(len(rings) - 1)
            for k in range(4)
            for a, b in [(4 * ring + k, 4 * ring + (k + 1) % 4)]
            for f in ((a, b, a + 4), (b, b + 4, a + 4))
        ]
        top = 4 * (len(rings) - 1)
        faces = np.array([*sides, (0, 2, 1), (0, 3, 2), (top, top + 1, top + 2), (top, top + 2, top + 3)])
        mesh = Mesh(np.array(places) + at, faces[:, ::-1], name)
        indices = np.zeros((len(places), 4), np.uint16)
        indices[:, 0] = 1 + np.clip((np.array(places)[:, 1] / length * bones).astype(int), 0, bones - 1)
        weights = np.tile(np.float32([1, 0, 0, 0]), (len(places), 1))
        names = tuple(f"{name} {k}" for k in range(bones + 1))
        joints = np.stack([np.zeros(bones + 1), heights, np.zeros(bones + 1)], 1) + at
        skeleton = Skeleton(names, np.arange(-1, bones, dtype=np.int32), joints)
        return still_shape(name, skeleton, mesh, SkinWeights(indices, weights))

    return make
