"""Compares a character rendered by enliven and by three.js, with the same camera and without lighting."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from three_viewer import Job, render_jobs

from enliven.deformation.skinning import skin_vertices
from enliven.document import Character, Pose
from enliven.meshes import MeshMaterials
from enliven.meshes.gltf.srgb import linear_from_srgb
from enliven_viewer.render.camera import CameraView, look_at, make_perspective
from enliven_viewer.render.gl.context import create_offscreen_context
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import PLAIN, Scene, SceneCharacter
from enliven_viewer.settings import RenderSettings

SIZE = 256
"""Side of each image, pixels."""
_CELL_PX = 16
"""Side of each region for comparing mean colours, pixels."""
_FULL_OPACITY = 0.25
"""Minimum fraction of a region that both renderers must cover. Regions at edges have too few pixels for a
mean."""
_CAMERA_ELEVATION = 50.0
"""Height by which everything is raised, metres. Otherwise enliven's floor would hide lower parts."""
_CAMERA_AZIMUTH = np.array([0.5, 0.35, 0.8])
"""Direction from the subject to the camera."""
_BRIGHT_COLOUR = {"emissiveFactor": [1000.0, 0.0, 1000.0], "extensions": {"KHR_materials_unlit": {}}}
"""A material that is magenta everywhere, which does not occur elsewhere in the image."""


@dataclass(frozen=True)
class Similarity:
    """The similarity of two images of the same pose.

    Attributes:
        overlap: intersection over union of the silhouettes.
        colours: (K,) the largest difference of a region's mean colour, 0..255.
    """

    overlap: float
    colours: np.ndarray


def compare(
    character: Character, poses: Sequence[Pose], files: Sequence[tuple[bytes, Sequence[float | None]]],
    folder: Path,
) -> tuple[list[list[Similarity]], np.ndarray]:  # fmt: skip
    """Returns one row per file with its comparison at each pose, and one image (H, W, 3) of all.

    Args:
        files: GLB files, each with the seconds of its animation at each pose; None for the file at rest.
        folder: folder for the browser's files.
    """
    camera = lower_camera(view_of(character, poses))
    jobs = [Job(file, camera, (SIZE, SIZE), second) for file, times in files for second in times]
    return compare_drawn(character, poses, render_jobs(jobs, folder))


def compare_drawn(
    character: Character, poses: Sequence[Pose], drawn: Sequence[np.ndarray]
) -> tuple[list[list[Similarity]], np.ndarray]:
    """Compares images of another renderer; returns what :func:`compare` does.

    Args:
        drawn: (H, W, 4) images with the camera of :func:`view_of`, lowered; one for each pose, for each file.
    """
    view = view_of(character, poses)
    renderer = Renderer(
        create_offscreen_context(), (SIZE, SIZE), RenderSettings(shadow_size=64, contact_size=32)
    )
    own = [_render_with_enliven(renderer, make_unlit(character), pose, view) for pose in poses]
    shown = [_silhouette(_render_with_enliven(renderer, brighten(character), pose, view)) for pose in poses]
    rows, strips = [], [np.concatenate(own, 1)]
    for number in range(len(drawn) // len(poses)):
        theirs = drawn[number * len(poses) : (number + 1) * len(poses)]
        rows.append([_measure_similarity(*three) for three in zip(own, shown, theirs, strict=True)])
        strips.append(np.concatenate([_apply_tone_curve(picture) for picture in theirs], 1))
    return rows, np.concatenate(strips).clip(0, 255).astype(np.uint8)


def view_of(character: Character, poses: Sequence[Pose]) -> CameraView:
    """Returns a camera that sees all poses, raised by :data:`_CAMERA_ELEVATION`."""
    reached = np.concatenate([skin_vertices(character, pose) for pose in poses])
    low, high = reached.min(0).astype(float), reached.max(0).astype(float)
    middle, radius = (low + high) / 2 + [0.0, _CAMERA_ELEVATION, 0.0], float(np.linalg.norm(high - low)) / 2
    eye = middle + _CAMERA_AZIMUTH / np.linalg.norm(_CAMERA_AZIMUTH) * 3.5 * radius
    return CameraView(eye, look_at(eye, middle), make_perspective(0.62, 1.0, 1.5 * radius, 6.0 * radius))


def make_unlit(character: Character) -> Character:
    """Returns the character with unlit materials. Plain colours become a material."""
    own = character.materials
    if own is None:
        assert character.colours is not None
        tints = np.ones((len(character.faces), 3, 4), np.float32)
        tints[..., :3] = linear_from_srgb(character.colours)[character.faces]
        definition, uvs = json.dumps({"doubleSided": True}), np.zeros((len(tints), 3, 0, 2), np.float32)
        own = MeshMaterials((definition,), (), np.zeros(len(tints), np.int32), uvs, tints)
    return _with_materials(character, own, {"extensions": {"KHR_materials_unlit": {}}}, "unlit")


def brighten(character: Character) -> Character:
    """Returns the character in plain magenta. Transparent holes in its texture stay."""
    own = make_unlit(character).materials
    assert own is not None
    return _with_materials(character, own, _BRIGHT_COLOUR, "bright")


def _with_materials(character: Character, own: MeshMaterials, change: dict, name: str) -> Character:
    definitions = list[str]()
    for definition in own.definitions:
        value = json.loads(definition)
        value.pop("emissiveTexture", None)
        value["emissiveFactor"] = [0.0, 0.0, 0.0]
        value |= change
        if change is _BRIGHT_COLOUR:
            base = value.setdefault("pbrMetallicRoughness", {})
            base["baseColorFactor"] = [0.0, 0.0, 0.0, base.get("baseColorFactor", [1.0] * 4)[3]]
        definitions.append(json.dumps(value))
    return replace(character, id=name, materials=replace(own, definitions=tuple(definitions)))


def lower_camera(view: CameraView) -> np.ndarray:
    """Returns (4, 4) clip_from_world of the same camera, for models that are not raised."""
    raised = np.eye(4)
    raised[1, 3] = _CAMERA_ELEVATION
    return view.clip_from_world @ raised


def _render_with_enliven(
    renderer: Renderer, character: Character, pose: Pose, view: CameraView
) -> np.ndarray:
    """Returns (H, W, 3) 0..255 the image rendered by enliven."""
    up = np.array([0.0, _CAMERA_ELEVATION, 0.0], np.float32)
    raised = replace(pose, positions=pose.positions + up)
    renderer.draw(Scene((SceneCharacter(character, raised),), (), PLAIN), view)
    return renderer.pixels().astype(float)


def _silhouette(picture: np.ndarray) -> np.ndarray:
    """Returns (H, W) True for pixels that are magenta by at least one half."""
    return (picture[..., 0] + picture[..., 2]) / 2 - picture[..., 1] > 110


def _apply_tone_curve(picture: np.ndarray) -> np.ndarray:
    """Returns (H, W, 3) 0..255 three.js's pixels after the tone curve of shaders/develop.glsl. The background
    is black.
    """
    cover = picture[..., 3:] / 255.0
    colour = np.divide(picture[..., :3], cover, out=np.zeros(picture[..., :3].shape), where=cover > 0)
    across = (np.arange(SIZE) + 0.5) / SIZE - 0.5
    light = (
        linear_from_srgb(colour.clip(0, 255)) * (0.98 - 0.72 * (across**2 + across[:, None] ** 2))[..., None]
    )
    light = np.maximum(light - 0.002, 0.0)
    film = light * (6.2 * light + 0.5) / (light * (6.2 * light + 1.7) + 0.06)
    return np.where(cover > 0, 255 * film, 0.0)


def _measure_similarity(own: np.ndarray, shown: np.ndarray, theirs: np.ndarray) -> Similarity:
    covered = theirs[..., 3] > 127
    overlap = (covered & shown).sum() / max((covered | shown).sum(), 1)
    both = _erode(shown & (theirs[..., 3] == 255))
    difference = np.where(both[..., None], own - _apply_tone_curve(theirs), 0.0)
    cells = SIZE // _CELL_PX
    total = difference.reshape(cells, _CELL_PX, cells, _CELL_PX, 3).sum((1, 3))
    count = both.reshape(cells, _CELL_PX, cells, _CELL_PX).sum((1, 3))
    full = count > _FULL_OPACITY * _CELL_PX**2
    return Similarity(float(overlap), np.abs(total[full] / count[full][:, None]).max(1))


def _erode(shown: np.ndarray) -> np.ndarray:
    """Returns (H, W) True for pixels with all eight neighbours in the shape. The renderers antialias edges
    differently.
    """
    inner = np.pad(shown, 1)
    return np.logical_and.reduce(
        [inner[1 + y : SIZE + 1 + y, 1 + x : SIZE + 1 + x] for y in (-1, 0, 1) for x in (-1, 0, 1)]
    )
