"""A contact sheet of a motion: a row of the performer above a row of the model, at the same times."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from enliven.arrays import Float, Float32, UInt8
from enliven.deformation.skinning import skin_vertices
from enliven.document import (
    Character,
    Clip,
    Pose,
    Project,
    RiggedCharacter,
    Skeleton,
    character_of,
    still_shape,
)
from enliven.exporters import make_octahedral_bone_mesh
from enliven.formats.rig.rig import play_clip
from enliven.mapping.automatic_mapping import RetargetedShape
from enliven.motion.layers.evaluate import Player
from enliven_viewer.film.sheet import Tile, write_sheet
from enliven_viewer.render.camera import Box, OrbitCamera
from enliven_viewer.render.gl.context import create_offscreen_context
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import Scene, SceneCharacter, SceneStyle

PERFORMER_COLOUR = (120, 190, 255)
"""sRGB of the performer."""
CAMERA_AZIMUTH = math.radians(38)
"""Azimuth of the camera in radians, from the character's front towards its left."""
_ELEVATIONS = (math.radians(12), math.radians(38))
"""Elevation of the camera in radians: first for a tall subject, then for a flat one."""
_FLAT_RATIO = 0.5
"""Ratio of height to largest extent below which a subject begins to count as flat."""
_MAX_EXTENT_M = 1.75
"""Subjects are scaled to this largest extent in metres, because light and floor are designed for people."""


@dataclass(frozen=True)
class MotionRow:
    """A row of a motion sheet: a character in several poses, all seen from one side.

    Attributes:
        azimuth: azimuth of the camera about +Y in radians.
        surfaces: (V, 3) float32 metres in the world for each pose; None if the transforms move the vertices.
    """

    character: Character
    poses: list[Pose]
    azimuth: float
    surfaces: list[Float32] | None = None


def write_motion_sheet(
    path: Path,
    retargeted: RetargetedShape,
    title: str,
    *,
    frames: int = 6,
    size: tuple[int, int] = (420, 420),
) -> None:
    """Draws the sheet as PNG.

    Args:
        frames: number of times, evenly distributed over the take.
        size: size of each image in pixels.

    Raises:
        ResourceError: if OpenGL is missing, or the file cannot be written.
    """
    times = np.linspace(0.0, retargeted.duration, frames)
    rows = [_make_take_row(retargeted, times), _make_model_row(retargeted, times)]
    write_rows(
        path, rows, times, title, f"{retargeted.duration:.1f} s, {len(retargeted.plan.chains)} chains", size
    )


def write_rows(
    path: Path, rows: Sequence[MotionRow], times: Float, title: str, subtitle: str, size: tuple[int, int]
) -> None:
    """Writes a sheet of rows of images. Each column shows the same time. Each image has ``size`` pixels."""
    renderer = Renderer(create_offscreen_context(), size)
    tiles = [
        Tile(second, picture)
        for row in rows
        for second, picture in zip(times, draw_pictures(renderer, row), strict=True)
    ]
    write_sheet(path, tiles, len(times), title, subtitle)


def make_performer_row(
    clip: Clip, facing: float, travels: bool, seconds: Sequence[float] | Float
) -> MotionRow:
    """Returns the row of a take's own skeleton at given times. ``facing`` is its azimuth in radians."""
    project, shape = play_clip(Project(), make_stick_shape("performer", clip.skeleton), clip)
    if not travels:
        project = project.with_characters(shape.with_changes(travel=None))
    player = Player(project, shape.id)
    return MotionRow(
        character_of(shape),
        [player.compute_message_pose(second) for second in seconds],
        facing + CAMERA_AZIMUTH,
    )


def _make_model_row(retargeted: RetargetedShape, times: Float) -> MotionRow:
    player = Player(retargeted.project, retargeted.shape_id)
    shape = retargeted.project.shape(retargeted.shape_id)
    return MotionRow(
        character_of(shape),
        [player.compute_message_pose(t) for t in times],
        retargeted.model_facing + CAMERA_AZIMUTH,
    )


def _make_take_row(retargeted: RetargetedShape, times: Float) -> MotionRow:
    return make_performer_row(retargeted.clip, retargeted.take_facing, retargeted.plan.travel, times)


def make_stick_shape(name: str, skeleton: Skeleton) -> RiggedCharacter:
    """Returns a shape that displays a skeleton: a slender double pyramid for every bone."""
    mesh, skin = make_octahedral_bone_mesh(skeleton)
    if mesh is not None:
        mesh = replace(
            mesh, name=name, colours=np.tile(np.array(PERFORMER_COLOUR, np.uint8), (len(mesh.vertices), 1))
        )
    return still_shape(name, skeleton, mesh, skin)


def draw_pictures(renderer: Renderer, film: MotionRow) -> list[UInt8]:
    """Returns images of all poses from one camera that frames all of them."""
    surfaces = film.surfaces or [skin_vertices(film.character, pose) for pose in film.poses]
    all_points = np.stack(surfaces)
    low, high = all_points.min((0, 1)).astype(float), all_points.max((0, 1)).astype(float)
    scale = _MAX_EXTENT_M / max(float((high - low).max()), 1e-9)
    foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    box: Box = ((low - foot) * scale, (high - foot) * scale)
    character = replace(
        film.character,
        vertices=((film.character.vertices - foot) * scale).astype(np.float32),
        pivots=((film.character.pivots - foot) * scale).astype(np.float32),
    )
    camera, aspect = OrbitCamera(math.radians(26)), renderer.size[0] / renderer.size[1]
    flatness = 1.0 - min(float(box[1][1] - box[0][1]) / (_FLAT_RATIO * _MAX_EXTENT_M), 1.0)
    camera.face(film.azimuth, _ELEVATIONS[0] + flatness * (_ELEVATIONS[1] - _ELEVATIONS[0]))
    camera.frame(box, aspect, at_once=True, margin=1.04)
    pictures = []
    for pose, surface in zip(film.poses, surfaces, strict=True):
        placed_pose = replace(pose, positions=((pose.positions - foot) * scale).astype(np.float32))
        placed_surface = ((surface - foot) * scale).astype(np.float32) if film.surfaces else None
        renderer.draw(
            Scene(
                (SceneCharacter(character, placed_pose, vertices=placed_surface),),
                (),
                SceneStyle(0, 0, 0),
                extent=box,
            ),
            camera.view(aspect),
        )
        pictures.append(renderer.pixels())
    return pictures
