"""Keys and mouse, turned into moves of the camera and the playhead."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import glfw

from enliven_viewer.live.app import App
from enliven_viewer.live.hud import timeline_fraction
from enliven_viewer.live.possession_choice import PARTS
from enliven_viewer.render import DRAG_TURN
from enliven_viewer.window import toggle_full_screen

_KEY_TURN = 0.12
"""Radians that the camera turns per press of an arrow key with Shift: seven degrees."""


class KeyBindings:
    """Turns the keys and the mouse of a window into calls of an app."""

    def __init__(self, app: App, window: Any) -> None:
        self._app, self._window = app, window
        self._held: int | None = None
        self._scrubbing = False
        self._cursor = (0.0, 0.0)
        self._windowed: tuple[int, int, int, int] | None = None
        glfw.set_key_callback(window, self._on_key)
        glfw.set_mouse_button_callback(window, self._on_button)
        glfw.set_cursor_pos_callback(window, self._on_move)
        glfw.set_scroll_callback(window, lambda window, across, up: app.camera.zoom(0.88**up))

    def _on_key(self, window: Any, key: int, code: int, action: int, modifiers: int) -> None:
        if action == glfw.RELEASE:
            return
        app, head = self._app, self._app.playhead
        if action == glfw.PRESS and glfw.KEY_1 <= key < glfw.KEY_1 + len(PARTS):
            app.choose_parts(key - glfw.KEY_1)
        elif action == glfw.PRESS and key in _ONCE:
            _ONCE[key](app)
        elif action == glfw.PRESS and key == glfw.KEY_ESCAPE:
            glfw.set_window_should_close(window, True)
        elif action == glfw.PRESS and key == glfw.KEY_F11:
            self._windowed = toggle_full_screen(window, self._windowed)
        elif modifiers & glfw.MOD_SHIFT and key in _TURNS:
            app.camera.orbit(*_TURNS[key])
        elif key in (glfw.KEY_LEFT, glfw.KEY_RIGHT):
            head.step(1 if key == glfw.KEY_RIGHT else -1)
        elif key in (glfw.KEY_UP, glfw.KEY_DOWN):
            head.faster(1 if key == glfw.KEY_UP else -1)
        elif key in (glfw.KEY_EQUAL, glfw.KEY_KP_ADD, glfw.KEY_MINUS, glfw.KEY_KP_SUBTRACT):
            app.camera.zoom(0.9 if key in (glfw.KEY_EQUAL, glfw.KEY_KP_ADD) else 1 / 0.9)

    def _on_button(self, window: Any, button: int, action: int, modifiers: int) -> None:
        if action == glfw.RELEASE:
            self._held, self._scrubbing = None, False
            return
        self._held = button
        fraction = self._timeline_at_cursor() if button == glfw.MOUSE_BUTTON_LEFT else None
        if fraction is not None:
            self._scrubbing = True
            self._app.playhead.scrub(fraction)

    def _on_move(self, window: Any, x: float, y: float) -> None:
        across, down = x - self._cursor[0], y - self._cursor[1]
        self._cursor = (x, y)
        if self._held is None:
            return
        height = max(glfw.get_window_size(self._window)[1], 1)
        shift = glfw.get_key(self._window, glfw.KEY_LEFT_SHIFT) == glfw.PRESS
        if self._scrubbing:
            # The cursor may have left the track.
            self._app.playhead.scrub(self._app.fraction_along(self._in_pixels(x, 0.0)[0]))
        elif self._held == glfw.MOUSE_BUTTON_LEFT and not shift:
            self._app.camera.orbit(-DRAG_TURN * across, DRAG_TURN * down)
        else:
            self._app.camera.pan(-across / height, down / height)

    def _timeline_at_cursor(self) -> float | None:
        x, y, ratio = self._in_pixels(*self._cursor)
        size = glfw.get_framebuffer_size(self._window)
        return timeline_fraction(x, y, size, self._app.scale) if ratio else None

    def _in_pixels(self, x: float, y: float) -> tuple[float, float, float]:
        """Screen coordinates as the framebuffer's pixels, and the ratio between them."""
        wide = glfw.get_window_size(self._window)[0]
        ratio = glfw.get_framebuffer_size(self._window)[0] / wide if wide else 0.0
        return x * ratio, y * ratio, ratio


_TURNS = {
    glfw.KEY_LEFT: (-_KEY_TURN, 0.0),
    glfw.KEY_RIGHT: (_KEY_TURN, 0.0),
    glfw.KEY_UP: (0.0, _KEY_TURN),
    glfw.KEY_DOWN: (0.0, -_KEY_TURN),
}


def _toggle(name: str) -> Any:
    """The action of a key that switches one overlay on or off."""

    def act(app: App) -> None:
        app.style = replace(app.style, **{name: 0.0 if getattr(app.style, name) > 0 else 1.0})

    return act


def _toggle_skeleton(app: App) -> None:
    shown = 0.0 if app.style.body > 0 else 1.0
    app.style = replace(app.style, body=shown, reveal=shown, cues=shown)


def _toggle_help(app: App) -> None:
    app.help = not app.help


_ONCE = {
    glfw.KEY_SPACE: lambda app: app.playhead.toggle_pause(),
    glfw.KEY_L: lambda app: app.playhead.go_live(),
    glfw.KEY_P: lambda app: app.possess(),
    glfw.KEY_J: lambda app: app.possess("join"),
    glfw.KEY_E: lambda app: app.possess("extend"),
    glfw.KEY_R: lambda app: app.release(),
    glfw.KEY_K: lambda app: app.toggle_lock(),
    glfw.KEY_COMMA: lambda app: app.smoother(-1),
    glfw.KEY_PERIOD: lambda app: app.smoother(1),
    glfw.KEY_N: lambda app: app.browse(1),
    glfw.KEY_M: lambda app: app.browse(-1),
    glfw.KEY_V: lambda app: app.show_bones(),
    glfw.KEY_B: lambda app: app.choose_performer(),
    glfw.KEY_F: lambda app: app.frame_all(),
    glfw.KEY_A: lambda app: app.frame_all(),
    glfw.KEY_G: _toggle("graph"),
    glfw.KEY_S: _toggle_skeleton,
    glfw.KEY_H: _toggle_help,
}
