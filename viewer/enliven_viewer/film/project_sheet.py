"""A contact sheet of a project: all its characters at several times, from one camera."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from enliven.document import Project
from enliven.person import Body
from enliven_viewer.film.project_scenes import ProjectScenes
from enliven_viewer.film.sheet import Tile, write_sheet
from enliven_viewer.playback.document import find_bounds
from enliven_viewer.render.camera import OrbitCamera
from enliven_viewer.render.gl.context import create_offscreen_context
from enliven_viewer.render.renderer import Renderer

_AZIMUTH, _ELEVATION = math.radians(38), math.radians(14)
"""Azimuth of the camera from the front towards the left, and its elevation, in radians."""
_MAX_COLUMNS = 6
"""Maximum number of images in one row."""


def write_project_sheet(
    path: Path | str,
    project: Project,
    times: Sequence[float],
    title: str = "",
    *,
    bodies: Sequence[Body] = (),
    size: tuple[int, int] = (420, 420),
) -> None:
    """Draws the characters of a project at several times as one PNG.

    Args:
        times: times in the project in seconds.
        title: text above the images.
        bodies: a performer for each time, drawn with the characters. Empty for none.
        size: size of each image in pixels (width, height).

    Raises:
        ValueError: if the numbers of bodies and times differ.
        InputError: if a character has no mesh.
        ResourceError: if OpenGL is missing, or the file cannot be written.
    """
    if bodies and len(bodies) != len(times):
        raise ValueError(f"{len(bodies)} bodies for {len(times)} times")
    source = ProjectScenes()
    scenes = [source.scene(project, time, bodies[index : index + 1]) for index, time in enumerate(times)]
    box = find_bounds([np.stack(scene.box) for scene in scenes if scene.box is not None])
    if box is None:
        return
    renderer, camera = Renderer(create_offscreen_context(), size), OrbitCamera(math.radians(28))
    camera.face(_AZIMUTH, _ELEVATION)
    camera.frame(box, size[0] / size[1], at_once=True)
    tiles = []
    for time, scene in zip(times, scenes, strict=True):
        renderer.draw(scene, camera.view(size[0] / size[1]))
        tiles.append(Tile(time, renderer.pixels()))
    write_sheet(Path(path), tiles, _MAX_COLUMNS, title, ", ".join(project.characters))
