"""Draws a played act: the performer on the left, the puppet on the right, and its key poses next to it."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from example_play import Play, Shot
from PIL import Image

from enliven.arrays import Float, UInt8
from enliven.film.writer import FilmWriter
from enliven_viewer.film.sheet import Tile, write_sheet
from enliven_viewer.live.hud import format_time
from enliven_viewer.render.camera import CameraView, OrbitCamera
from enliven_viewer.render.gl.context import create_offscreen_context
from enliven_viewer.render.overlay.canvas import Canvas
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import Scene, SceneCharacter, SceneStyle

SIZE, RATE, BIT_RATE = (1280, 720), 30.0, 6.0
_TILES, _TILE_WIDTH = 24, 480
MOST_KEYS = 4
_PERFORMER = 0.30
"""Fraction of the image's width used for the performer."""
_INK, _QUIET = (0.95, 0.96, 0.98, 0.95), (0.80, 0.83, 0.88, 0.85)
_ABOVE = math.radians(9)


class Panel:
    """A part of the image with its own renderer and camera."""

    def __init__(self, renderer: Renderer, canvas: Canvas) -> None:
        self.renderer, self.canvas = renderer, canvas

    @property
    def size(self) -> tuple[int, int]:
        """Returns the width and height of the panel in pixels."""
        return self.renderer.size

    def view(self, middle: Float, half: Float, azimuth: float) -> CameraView:
        """Returns a camera with an image that contains a box around a position on the floor."""
        aspect = self.size[0] / self.size[1]
        camera = OrbitCamera()
        camera.face(azimuth, _ABOVE)
        low = np.array([middle[0] - half[0], 0.0, middle[2] - half[2]])
        camera.frame((low, low + 2 * half), aspect, at_once=True)
        return camera.view(aspect)

    def draw(
        self, scene: Scene, view: CameraView, texts: list[tuple[float, float, str, int, float]]
    ) -> UInt8:
        """Returns an image (H, W, 3) of a scene with lines of text (x, y, text, size, align)."""
        self.renderer.draw(scene, view)
        with self.canvas.draw_over(self.renderer.picture.resolved):
            for x, y, text, size, align in texts:
                self.canvas.text(x + 1, y + 1, text, size, (0.0, 0.0, 0.0, 0.5), align=align)
                self.canvas.text(x, y, text, size, _INK if size > 16 else _QUIET, align=align)
        return self.renderer.pixels()


class Studio:
    """The two panels, for all films.

    Args:
        size: size of the image, pixels.
    """

    def __init__(self, size: tuple[int, int] = SIZE) -> None:
        self.size = size
        ctx = create_offscreen_context()
        self._text = max(round(size[1] / 36), 8)
        self._small = max(round(size[1] / 48), 7)
        narrow = round(_PERFORMER * size[0]) // 2 * 2
        column = size[0] // 8
        sizes = ((narrow, size[1]), (size[0] - narrow - column, size[1]), (column, size[1] // MOST_KEYS))
        self._left, self._right, self._thumb = (Panel(Renderer(ctx, size), Canvas(ctx)) for size in sizes)

    def film(self, plays: list[Play], path: Path, see: Callable[[Shot], None]) -> int:
        """Writes the film and its contact sheet. Returns the number of frames. ``see`` is called with each
        shot."""
        tiles: list[Tile] = []
        every = -(-sum(len(play.times) for play in plays) // _TILES)
        with FilmWriter(path.with_suffix(".mp4"), self.size, RATE, BIT_RATE) as writer:
            for play in plays:
                strip = self.strip(play)
                for number, shot in enumerate(play.shots()):
                    see(shot)
                    picture = self.picture(play, number, shot, strip)
                    if writer.count % every == 0:
                        tiles.append(Tile(writer.count / RATE, _halve_image(picture, _TILE_WIDTH)))
                    writer.add(picture)
            write_sheet(
                path.with_suffix(".png"), tiles, 4, plays[0].act.title, format_time(writer.count / RATE)
            )
        return writer.count

    def picture(self, play: Play, number: int, shot: Shot, strip: UInt8 | None) -> UInt8:
        """Returns an image (H, W, 3) of one frame."""
        azimuth = math.radians(play.shown.azimuth)
        puppet, performer = (way[number] for way in play.ways)
        margin, line = 1.1 * self._text, 1.35 * self._text
        width, height = self._left.size
        left = self._left.draw(
            Scene((), (shot.body,), SceneStyle(body=1.0, reveal=0.0, cues=0.0)),
            self._left.view(performer, np.array([0.95, 0.95, 0.4]), azimuth),
            [
                (margin, margin, "Performer", self._text, 0.0),
                (margin, margin + line, Path(play.act.take).stem.replace("_", " "), self._small, 0.0),
                (width - margin, height - 2 * margin, _format_pace(play, shot), self._small, 1.0),
            ],
        )
        act, points = play.act, len(play.puppet.points)
        title = f"{Path(act.mesh).name}, {len(play.puppet.mesh.vertices):,} vertices"
        shown = f"{points} control points, {len(play.puppet.poses)} example poses"
        actor = SceneCharacter(play.character, shot.pose, vertices=shot.vertices)
        right = self._right.draw(
            Scene((actor,), (), SceneStyle(body=0.0, reveal=0.0, cues=0.0, graph=0.55)),
            self._right.view(puppet, compute_half_size(play), azimuth),
            [
                (margin, margin, act.title, self._text, 0.0),
                (margin, margin + line, f"{title}  ·  {shown}", self._small, 0.0),
            ],
        )
        column = np.zeros((self.size[1], self._thumb.size[0], 3), np.uint8) if strip is None else strip
        return np.hstack([left, right, column])

    def strip(self, play: Play) -> UInt8:
        """Returns an image (h, w, 3) of the key poses, one below the other."""
        half, pictures = 0.9 * compute_half_size(play), []
        azimuth = math.radians(play.shown.azimuth)
        surface = play.surface()
        size = self._thumb.size
        for key, pose in zip(play.act.keys, play.puppet.poses, strict=False):
            vertices = surface.solve_from_rest(pose.places).astype(np.float32)
            actor = SceneCharacter(play.character, play.character.rest_pose(), vertices=vertices)
            texts = [(size[0] / 2, size[1] - 1.7 * self._small, key.sees, self._small, 0.5)]
            scene = Scene((actor,), (), SceneStyle(body=0.0, reveal=0.0, cues=0.0))
            picture = self._thumb.draw(scene, self._thumb.view(np.zeros(3), half, azimuth), texts)
            picture[[0, -1]] = picture[:, [0, -1]] = (90, 96, 110)
            pictures.append(picture)
        strip = np.full((self.size[1], size[0], 3), (24, 27, 34), np.uint8)
        strip[: len(pictures) * size[1]] = np.vstack(pictures)
        return strip


def compute_half_size(play: Play) -> Float:
    """Returns (3,) half the size of the box that the camera shows."""
    low, high = play.puppet.mesh.bounds
    reach = 1.15 * max(high[0] - low[0], high[2] - low[2]) / 2
    return np.array([reach, max(0.64 * play.act.height, 0.3 * reach), 0.6 * reach])


def _format_pace(play: Play, shot: Shot) -> str:
    """Returns the time in the take, and the speed if it is not 1, as text."""
    slow = "" if play.shown.speed == 1.0 else f"  ·  {play.shown.speed:g} of its speed"
    return format_time(shot.seconds) + slow


def _halve_image(picture: UInt8, width: int) -> UInt8:
    height = round(picture.shape[0] * width / picture.shape[1])
    return np.asarray(Image.fromarray(picture).resize((width, height), Image.Resampling.LANCZOS), np.uint8)
