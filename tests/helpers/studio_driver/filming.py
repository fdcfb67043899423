"""Films of sessions: drives the real window with the session's input, and writes its frames into an MP4."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from imgui_bundle import imgui

from enliven.film.writer import FilmWriter
from enliven_viewer.film.sheet import Tiles, write_sheet
from enliven_viewer.studio.actions.imgui_keys import KEYS
from enliven_viewer.studio.viewport.overlay import Point
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace
from studio_driver import STEP, Action, steps

_BIT_RATE = 6.0
"""Bit rate of the film, Mbit/s, at which the small text of panels stays readable."""


class WindowStage:
    """A stage that passes its input to ImGui like a mouse and a keyboard. Places are the window's pixels."""

    pace = 0.35

    def __init__(self, window: StudioWindow) -> None:
        self._window, self.workspace = window, window.workspace
        self.at: Point = (0.0, 0.0)
        self._up: list[imgui.Key] = []

    def settle(self) -> None:
        """Releases keys that were pressed in the previous frame, and repeats the pointer position."""
        io = imgui.get_io()
        for key in self._up:
            io.add_key_event(key, False)
        self._up = []
        io.add_mouse_pos_event(*self.at)

    def move(self, at: Point) -> None:
        self.at = at
        imgui.get_io().add_mouse_pos_event(*at)

    def button(self, button: int, down: bool) -> None:
        imgui.get_io().add_mouse_button_event(button, down)

    def shift(self, down: bool) -> None:
        imgui.get_io().add_key_event(imgui.Key.mod_shift, down)

    def key(self, key: str) -> None:
        *modifiers, name = key.split("+")
        pressed = [getattr(imgui.Key, f"mod_{modifier}") for modifier in modifiers] + [KEYS[name]]
        for pressed_key in pressed:
            imgui.get_io().add_key_event(pressed_key, True)
        self._up = pressed

    def write(self, text: str) -> None:
        imgui.get_io().add_input_characters_utf8(text)

    def activate(self, name: str) -> bool:
        """Returns False, because widgets in a window are clicked."""
        return False

    def rename(self, name: str) -> bool:
        """Returns False, because a window has a text field."""
        return False

    def viewport(self) -> Point:
        area = self._window.places.viewport
        return area.x, area.y

    def source(self) -> Point:
        return self._corner("source")

    def timeline(self) -> Point:
        return self._corner("timeline")

    def widget(self, name: str) -> Point:
        left, top, right, bottom = self.workspace.widget(name)
        return (left + right) / 2, (top + bottom) / 2

    def _corner(self, name: str) -> Point:
        left, top, _, _ = self.workspace.widget(name)
        return left, top


def film(
    actions: Iterable[Action],
    workspace: Workspace,
    path: Path,
    *,
    title: str = "",
    every: int = 1,
    tiles: int = 12,
    pace: float = 0.0,
) -> int:
    """Plays a session in the window and writes a film of it, with a contact sheet.

    Args:
        every: only every ``every``-th frame is written to the film (at 30 frames per second).
        tiles: number of images in the contact sheet.
        pace: minimum wall-clock time per frame, seconds.

    Returns:
        Number of frames in the film.
    """
    window = StudioWindow(workspace, STEP)
    chosen = Tiles(tiles, 640)
    playing: list[Iterator[None]] = []
    settings = workspace.editor.settings
    size = (settings.width, settings.height)
    with FilmWriter(path, size, 1 / STEP / every, _BIT_RATE) as writer:

        def before(window: StudioWindow) -> None:
            time.sleep(max(last[0] + pace - time.monotonic(), 0.0))
            last[0] = max(last[0] + pace, time.monotonic() - pace)
            if window.pictures < 3:  # Panels must be drawn before their widgets can be found.
                return
            if not playing:
                stage = WindowStage(window)
                stages.append(stage)
                imgui.get_io().mouse_draw_cursor = True
                playing.append(steps(actions, stage))
            stages[0].settle()
            if next(playing[0], StopIteration) is StopIteration:
                window.close()

        def after(window: StudioWindow) -> None:
            if window.pictures > 3 and window.pictures % every == 0:
                picture = window.pixels()
                writer.add(picture)
                chosen.add(writer.count * STEP * every, picture)

        stages: list[WindowStage] = []
        last = [time.monotonic()]
        window.run(before=before, after=after)
    write_sheet(path.with_suffix(".png"), chosen.choose_tiles(), 3, title or path.stem, "enliven studio")
    return writer.count
