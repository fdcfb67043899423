"""Renders a short film of a project from one fixed camera, for documentation pages and messages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from enliven.arrays import Float, UInt8
from enliven.document import BOX, Project, Props
from enliven.errors import InputError
from enliven.files import write_picture
from enliven.film.writer import FilmWriter
from enliven.person import Body
from enliven_viewer.film.project_scenes import ProjectScenes
from enliven_viewer.render.camera import OrbitCamera
from enliven_viewer.render.gl.context import create_offscreen_context
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import Scene
from enliven_viewer.settings import LookName, RenderSettings

_FIELD_OF_VIEW = math.radians(28)
"""Vertical field of view in radians. It is narrow, like that of a portrait lens."""
FRAMED_FRACTION = 0.9
"""Maximum fraction of the image's width and height that the subject occupies at any time of the film."""
_HEAD_M = 0.16
"""Distance in metres from the head joint to the top of the drawn head, plus a margin."""
_BIT_RATE = 2.0
"""Mbit/s of an MP4 file, for encoders without a quality option."""
_SHADOW_SIZE = 768
"""Side length of the shadow map in pixels: twice the default, because a film is rendered once and watched
often.
"""
_WEBP_QUALITY = 75
"""Quality of a WebP file from 0 to 100. At this quality the floor shows no banding."""
_WEBP_METHOD = 4
"""Effort of the WebP encoder from 0 to 6. 6 takes ten times as long and saves less than 1 %."""


def write_project_film(
    path: Path | str,
    project: Project | Sequence[Project],
    times: Sequence[float],
    *,
    bodies: Sequence[Sequence[Body]] = (),
    props: Sequence[Props | None] = (),
    rate: float = 25.0,
    size: tuple[int, int] = (480, 300),
    azimuth: float = 38.0,
    elevation: float = 12.0,
    look: LookName = "studio",
    reveal: float = 1.0,
) -> None:
    """Renders the characters of a project as a film. The fixed camera frames the whole motion.

    Web pages show a .webp file like an image and loop it. The loop has no jump if the last image leads to the
    first.

    Args:
        path: the suffix determines the format: .webp, or .mp4.
        project: a project, or one project per image if the film shows an edit.
        times: time in the project for each image, in seconds.
        bodies: the performers for each image, drawn with the characters. Empty for none.
        props: the loose boxes and balls for each image. Empty for none.
        rate: images per second.
        size: size of the film in pixels (width, height).
        azimuth: direction of the camera in degrees: 0 is the front (+Z), 90 is the characters' left (+X).
        elevation: elevation of the camera in degrees.
        look: the light, backdrop and floor.
        reveal: transparency of a mesh around the performers inside it, from 0 to 1.

    Raises:
        ValueError: if the numbers of projects, bodies or props differ from the number of times.
        InputError: if a character has no mesh, there is nothing to film, or the suffix is unknown.
        ResourceError: if OpenGL is missing, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix not in (".webp", ".mp4"):
        problem = f"films with the extension {path.suffix or '(none)'} cannot be written"
        raise InputError(problem, where=str(path), remedy="Use the file extension .webp or .mp4.")
    source = ProjectScenes(reveal)
    scenes = [
        source.scene(version, time, people, loose_props)
        for time, version, people, loose_props in zip(
            times,
            _value_per_time(times, [project] if isinstance(project, Project) else project, "projects"),
            _value_per_time(times, bodies or [()], "bodies"),
            _value_per_time(times, props or [None], "props"),
            strict=True,
        )
    ]
    points = [_list_framed_points(scene) for scene in scenes]
    if not sum(map(len, points)):
        raise InputError("there is nothing to film", where="project", remedy="Add a character or performers.")
    settings = RenderSettings(look=look, shadow_size=_SHADOW_SIZE)
    renderer, camera = Renderer(create_offscreen_context(), size, settings), OrbitCamera(_FIELD_OF_VIEW)
    aspect = size[0] / size[1]
    frame_points(camera, np.concatenate(points), math.radians(azimuth), math.radians(elevation), aspect)
    images = []
    for scene in scenes:
        renderer.draw(scene, camera.view(aspect))
        images.append(renderer.pixels())
    _write_images(path, images, rate)


def _value_per_time(times: Sequence[float], values: Sequence[Any], name: str) -> Sequence[Any]:
    """Returns a value for each time. A single value is repeated for all times."""
    if len(values) not in (1, len(times)):
        raise ValueError(f"{len(values)} {name} for {len(times)} times")
    return values if len(values) == len(times) else [*values] * len(times)


def _list_framed_points(scene: Scene) -> Float:
    """Returns the points (N, 3) in metres that the camera must show. Loose balls are excluded, because they
    may leave the image.
    """
    points: list[Float] = [np.asarray(actor.extent, np.float64) for actor in scene.actors]
    for body in scene.bodies:
        points += [body.joints, body.joints + np.array([0.0, _HEAD_M, 0.0])]
    if scene.props is not None:
        points.append(scene.props.positions[scene.props.shapes == BOX])
    return np.concatenate(points) if points else np.zeros((0, 3))


def frame_points(camera: OrbitCamera, points: Float, azimuth: float, elevation: float, aspect: float) -> None:
    """Places a camera as close as possible so that it shows all points (N, 3).

    A point at (right, up, back) in the camera's axes is inside the image's left and right edge if
    ``|right - x| <= k (distance - back)``, and likewise for its height. So each edge bounds
    ``k distance + x`` or ``k distance - x``. For two opposite edges, the sum of both bounds gives the
    smallest distance, and their difference gives the centre x.
    """
    camera.go((0.0, 0.0, 0.0), azimuth, elevation, 1.0)
    camera.advance(10.0)
    rows = camera.view(aspect).camera_from_world[:3, :3]
    middle = (points.min(0) + points.max(0)) / 2
    right, up, back = rows @ (points - middle).T
    slope = FRAMED_FRACTION * math.tan(camera.field_of_view / 2)
    offset, distance = np.zeros(3), 0.0
    for axis, coordinates, k in ((0, right, slope * aspect), (1, up, slope)):
        high, low = (coordinates + k * back).max(), (k * back - coordinates).max()
        offset[axis] = (high - low) / 2
        distance = max(distance, (high + low) / (2 * k))
    camera.go(tuple(middle + offset @ rows), azimuth, elevation, distance)
    camera.advance(10.0)


def _write_images(path: Path, images: Sequence[UInt8], rate: float) -> None:
    """Writes images as a WebP file that loops, or as an MP4 file."""
    if path.suffix == ".mp4":
        with FilmWriter(path, None, rate, _BIT_RATE) as writer:
            for image in images:
                writer.add(image)
        return
    first, *other_images = map(Image.fromarray, images)
    options = {"quality": _WEBP_QUALITY, "method": _WEBP_METHOD, "duration": round(1000 / rate), "loop": 0}
    write_picture(path, first, save_all=True, append_images=other_images, **options)
