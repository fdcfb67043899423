"""Tests that real models show their own textures. Their mean equals that of the colours baked into
vertices.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from enliven.document import Character, Project
from enliven.document.rigged import character_of
from enliven.formats.gltf.read import read_gltf
from enliven.modeling.edits import cut_character
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.wire import character_to_message, message_to_character
from enliven_viewer.render.camera import OrbitCamera
from enliven_viewer.render.gl.context import create_offscreen_context
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import PLAIN, Scene, SceneCharacter

DATA = (
    Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[3] / "shared" / "data")) / "gltf" / "khronos"
)
SIZE = (320, 240)

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no models in {DATA} (set ENLIVEN_DATA)"),
]


@pytest.fixture(scope="module")
def renderer():
    context = create_offscreen_context()
    yield Renderer(context, SIZE)
    context.release()


def shown(renderer: Renderer, character: Character) -> np.ndarray:
    low, high = character.vertices.min(0), character.vertices.max(0)
    camera, aspect = OrbitCamera(0.6), SIZE[0] / SIZE[1]
    camera.frame((low, high), aspect, at_once=True)
    actor = SceneCharacter(character, character.rest_pose())
    renderer.draw(Scene((actor,), (), PLAIN, extent=(low, high)), camera.view(aspect))
    return renderer.pixels().astype(float)


@pytest.mark.parametrize("name", ["Fox", "CesiumMan", "Monster"])
def test_a_textured_model_has_the_colours_that_were_baked_on_the_whole(renderer, caplog, name: str) -> None:
    character = character_of(read_gltf(DATA / f"{name}.glb", height=1.5, floor=True, weld=True).shape)
    textured = shown(renderer, character)
    baked = shown(renderer, replace(character, materials=None))
    grey = shown(renderer, replace(character, materials=None, colours=None))
    assert not caplog.records
    body = abs(textured - grey).max(2) > 12
    assert body.mean() > 0.08
    # A vertex colour covers decimetres of a fox. The means are therefore equal, but the images are not.
    np.testing.assert_allclose(textured[body].mean(0), baked[body].mean(0), atol=24)
    assert (abs(textured - baked)[body].max(1) > 20).mean() > 0.24
    sent = message_to_character(character_to_message(character, 1))
    np.testing.assert_allclose(shown(renderer, sent), textured, atol=2)


def test_a_cut_fox_keeps_its_textures(renderer) -> None:
    shape = read_gltf(DATA / "Fox.glb", height=1.2, floor=True, weld=True).shape
    low, high = shape.mesh.vertices.min(0), shape.mesh.vertices.max(0)
    plane = PlaneCut((low + high) / 2, [0.0, 0.0, 1.0])
    project, parts = cut_character(Project().with_characters(shape), shape.id, plane, 0.0)
    for part in parts[:2]:
        half = character_of(project.characters[part])
        textured, bare = (
            shown(renderer, mesh) for mesh in (half, replace(half, materials=None, colours=None))
        )
        assert (abs(textured - bare).max(2) > 12).mean() > 0.1
        assert half.materials is not None and len(half.materials.textures) == 1
