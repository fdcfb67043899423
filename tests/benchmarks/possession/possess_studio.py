"""Draws a take with the viewer's own renderer. The performers step out of the mesh and stand next to it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from possess_take import Shot, Take

from enliven.arrays import UInt8
from enliven.film.writer import FilmWriter
from enliven.person.body import Body
from enliven_viewer.film.sheet import Tile, write_sheet
from enliven_viewer.live.hud import format_time
from enliven_viewer.playback.timeline import CueFrame
from enliven_viewer.render.camera import FilmCamera
from enliven_viewer.render.gl.context import create_offscreen_context
from enliven_viewer.render.overlay.canvas import Canvas
from enliven_viewer.render.renderer import EMPTY_BOX, Renderer
from enliven_viewer.render.scene import Scene, SceneCharacter, SceneStyle

SIZE, RATE, BIT_RATE = (1280, 720), 30.0, 5.0
_TEXT = 18
_RIGHT = np.array([math.cos(math.radians(32)), 0.0, -math.sin(math.radians(32))])
"""The right direction in the image of the film's camera."""
_STEP_OUT, _STEPPING, _ASIDE = 1.2, 1.0, 0.75
"""Seconds inside the mesh after attachment, seconds of stepping out, and the sideways distance as a multiple
of the height.
"""
_TILES, _COLUMNS, _TILE_WIDTH = 12, 4, 480


class Studio:
    """One renderer for all films."""

    def __init__(self, size: tuple[int, int] = SIZE) -> None:
        self.size = size
        self.renderer = Renderer(create_offscreen_context(), size)
        self._canvas = Canvas(self.renderer.ctx)

    def film(self, take: Take, path: Path, title: str) -> int:
        """Writes the film and its contact sheet. Returns the number of frames."""
        times = _times(take)
        tiles = set(np.linspace(0.03 * len(times), 0.97 * len(times), _TILES).astype(int).tolist())
        kept = []
        camera = FilmCamera()
        with FilmWriter(path.with_suffix(".mp4"), self.size, RATE, BIT_RATE) as writer:
            for n, time_ns in enumerate(times):
                picture = self.draw(take, time_ns, camera, title)
                writer.add(picture)
                if n in tiles:
                    kept.append(Tile(n / RATE, _halve_image(picture)))
        _sheet(path, kept, title, len(times))
        return len(times)

    def sheet(self, take: Take, path: Path, title: str, count: int = _TILES) -> None:
        """Writes only the contact sheet of ``count`` times. The camera follows the whole path."""
        times = _times(take)
        tiles = set(np.linspace(0.03 * len(times), 0.97 * len(times), count).astype(int).tolist())
        kept, camera = [], FilmCamera()
        for n, time_ns in enumerate(times):
            scene = self._scene(take, time_ns)
            camera.follow(scene.box or EMPTY_BOX, 1 / RATE, self.size[0] / self.size[1])
            if n in tiles:
                kept.append(Tile(n / RATE, _halve_image(self._picture(scene, camera, title, take, time_ns))))
        _sheet(path, kept, title, len(times))

    def draw(self, take: Take, time_ns: int, camera: FilmCamera, title: str) -> UInt8:
        scene = self._scene(take, time_ns)
        camera.follow(scene.box or EMPTY_BOX, 1 / RATE, self.size[0] / self.size[1])
        return self._picture(scene, camera, title, take, time_ns)

    def _picture(self, scene: Scene, camera: FilmCamera, title: str, take: Take, time_ns: int) -> UInt8:
        self.renderer.draw(scene, camera.view(self.size[0] / self.size[1]))
        second = (time_ns - take.shots[0].time_ns) * 1e-9
        word = "possessed" if _since(take, time_ns) >= 0 else "free"
        return self.labelled(self.renderer, title, f"{format_time(second)}  ·  {word}")

    def labelled(self, renderer: Renderer, title: str, below: str) -> UInt8:
        """Returns the last image of a renderer of this context, with text at its top left and bottom
        right."""
        width, height = self.size
        places = ((28, 28, title, 0.0), (width - 28, height - 46, below, 1.0))
        with self._canvas.draw_over(renderer.picture.resolved):
            for x, y, text, align in places:
                self._canvas.text(x + 1, y + 1, text, _TEXT, (0.0, 0.0, 0.0, 0.5), align=align)
                self._canvas.text(x, y, text, _TEXT, (0.95, 0.96, 0.98, 0.8), align=align)
        return renderer.pixels()

    def _scene(self, take: Take, time_ns: int) -> Scene:
        """Returns the scene at a time: the nearest shot, with its bodies stepping out of the mesh."""
        shot = _shot_at(take, time_ns)
        since = _since(take, time_ns)
        share = min(max((since - _STEP_OUT) / _STEPPING, 0.0), 1.0)
        share = share * share * (3 - 2 * share)
        bodies = tuple(_move_aside(body, share) for body in shot.bodies)
        cues = CueFrame(
            take.character.id, shot.cues.nodes.astype(np.int32), shot.cues.strengths.astype(np.float32)
        )
        actor = SceneCharacter(take.character, shot.pose, cues)
        # Next to the mesh, the performer does not make the mesh transparent, and attached parts do not glow.
        return Scene((actor,), bodies, SceneStyle(body=1.0, reveal=1.0 - share, cues=1.0 - share))


def _move_aside(body: Body, share: float) -> Body:
    """Returns the body, moved out of the mesh by a fraction of the way."""
    return replace(body, joints=body.joints + share * _ASIDE * body.height * _RIGHT)


def _since(take: Take, time_ns: int) -> float:
    """Returns the seconds since the first attachment, negative before it."""
    return (time_ns - take.held_ns[0]) * 1e-9 if take.held_ns else -1.0


def _times(take: Take) -> list[int]:
    first, last = take.shots[0].time_ns, take.shots[-1].time_ns
    return [first + round(n * 1e9 / RATE) for n in range(int((last - first) * 1e-9 * RATE) + 1)]


def _shot_at(take: Take, time_ns: int) -> Shot:
    times = np.array([shot.time_ns for shot in take.shots])
    return take.shots[int(np.abs(times - time_ns).argmin())]


def _halve_image(picture: UInt8) -> UInt8:
    from PIL import Image

    height = round(picture.shape[0] * _TILE_WIDTH / picture.shape[1])
    small = Image.fromarray(picture).resize((_TILE_WIDTH, height), Image.Resampling.LANCZOS)
    return np.asarray(small, np.uint8)


def _sheet(path: Path, tiles: list[Tile], title: str, count: int) -> None:
    write_sheet(path.with_suffix(".png"), tiles, _COLUMNS, title, format_time(count / RATE))
