"""The kiosk's window: fills one monitor without a border, and does not close for visitors."""

from __future__ import annotations

import contextlib
import logging
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# ImGui's bundle brings its own copy of GLFW's library and must be loaded before glfw.
# isort: off
import imgui_bundle  # noqa: F401
import glfw

# isort: on

from enliven.arrays import UInt8
from enliven.commands.processes import parent_is_gone
from enliven.errors import ResourceError
from enliven.kiosk.profile import KioskProfile
from enliven.kiosk.screen_lock import ScreenLock
from enliven.kiosk.souvenir_address import check_souvenir_address
from enliven.kiosk.spot import Press
from enliven.settings import load_settings
from enliven_viewer.kiosk.cue_sounds import CueSounds
from enliven_viewer.kiosk.operator_report import OperatorReport
from enliven_viewer.kiosk.painter import Painter
from enliven_viewer.kiosk.show import KioskShow
from enliven_viewer.kiosk.souvenir_maker import SouvenirMaker
from enliven_viewer.kiosk.stage_link import KioskLink
from enliven_viewer.language import find_language, set_language
from enliven_viewer.render.gl.context import get_window_context
from enliven_viewer.render.gl.targets import Size
from enliven_viewer.settings import RenderSettings, ViewerSettings, with_size
from enliven_viewer.souvenirs.store import make_store
from enliven_viewer.window import decode_error

log = logging.getLogger(__name__)

KEY_PRESSES: dict[int, Press] = {
    glfw.KEY_RIGHT: "next",
    glfw.KEY_LEFT: "previous",
    glfw.KEY_PAGE_DOWN: "next",
    glfw.KEY_PAGE_UP: "previous",
    glfw.KEY_SPACE: "take",
    glfw.KEY_ENTER: "take",
    glfw.KEY_BACKSPACE: "leave",
}
"""The kiosk's button for each key code of a keyboard, or of push buttons that act as a keyboard."""
QUIT_MODIFIERS = glfw.MOD_CONTROL | glfw.MOD_ALT
"""Modifier keys that must be pressed with Q to close the window. Visitors do not press them by chance."""
_SWEEP_INTERVAL_S = 60.0
"""Seconds between two deletions of old souvenirs. The souvenir server deletes them more often."""
_MAX_STEP_S = 0.5
"""Maximum time step of the show in seconds, for example after the program was suspended."""


@dataclass(frozen=True)
class _WindowPlacement:
    """The position and size of the window in screen coordinates, and whether it fills the monitor."""

    monitor: Any
    x: int
    y: int
    size: Size
    full: bool


class KioskWindow:
    """The window of one kiosk.

    Args:
        profile: the kiosk.
        folder: folder of the profile, for relative paths.
        link: the connection to the edges; None makes one.
        report: reports to operators; None for one that notifies this program's supervisor.

    Raises:
        ResourceError: if no screen exists, the profile's monitor does not exist, or OpenGL is missing.
    """

    def __init__(
        self,
        profile: KioskProfile,
        folder: Path,
        link: KioskLink | None = None,
        report: OperatorReport | None = None,
    ) -> None:
        self._profile = profile
        _begin_glfw()
        place = _find_place(profile)
        self._window = _open_window(profile, place)
        glfw.make_context_current(self._window)
        glfw.swap_interval(1)
        self._ctx = get_window_context()
        self._screen = self._ctx.detect_framebuffer()
        self._painter: Painter | None = None
        self._settings = _load_render_settings(profile, folder)
        self.show = KioskShow(profile, folder, link)
        self._report = report or OperatorReport()
        self._sounds = CueSounds(profile.story.sound)
        self._store = make_store(profile)
        self._swept_s = -_SWEEP_INTERVAL_S
        self.souvenirs = SouvenirMaker(profile, self._store) if profile.souvenir.kind else None
        self._presses: list[Press] = []
        self.is_closing = False
        self.pictures = 0
        glfw.set_key_callback(self._window, self._handle_key)
        glfw.set_input_mode(self._window, glfw.CURSOR, glfw.CURSOR_HIDDEN)

    @property
    def size(self) -> Size:
        """Returns width and height of the window in pixels."""
        width, height = glfw.get_framebuffer_size(self._window)
        return int(width), int(height)

    def run(self, seconds: float | None = None, after: Callable[[KioskWindow], None] | None = None) -> None:
        """Shows the window until Ctrl+Alt+Q, SIGTERM, or the supervisor's end.

        Args:
            seconds: close it after this time.
            after: called after each picture.
        """
        start_s = last = time.monotonic()
        while not self.is_closing and not parent_is_gone():
            now = time.monotonic()
            if seconds is not None and now - start_s > seconds:
                return
            self.draw(min(now - last, _MAX_STEP_S))
            last = now
            if after is not None:
                after(self)

    def draw(self, seconds: float) -> None:
        """Draws one picture, ``seconds`` after the previous one."""
        glfw.poll_events()
        if glfw.window_should_close(self._window):
            # Alt+F4 and a window manager's button do not close a kiosk.
            glfw.set_window_should_close(self._window, False)
        presses, self._presses = self._presses, []
        frame = self.show.advance(seconds, presses)
        self._sounds.play(frame.story.sound)
        painter = self._fit_painter()
        if painter is None:
            time.sleep(0.05)
            return
        painter.draw(self.show, frame, seconds, self.souvenirs)
        painter.present(self._screen, self.size, self._profile.screen.turn)
        glfw.swap_buffers(self._window)
        self.pictures += 1
        if self.pictures == 1:
            self._report.report_ready()
        now = time.monotonic()
        self._delete_old_souvenirs(now)
        souvenirs = "" if self.souvenirs is None else self.souvenirs.problem
        problem = frame.report.problem or frame.story.problem or " ".join(self.show.problems) or souvenirs
        self._report.report_picture(now, f"the screen shows: {frame.story.phase}", problem, painter.probe)
        self._report.write_picture_if_due(now, painter.pixels)

    def pixels(self) -> UInt8:
        """Returns (H, W, 3) sRGB of the last picture before its rotation, top row first."""
        assert self._painter is not None
        return self._painter.pixels()

    def close(self) -> None:
        """Closes the window."""
        self._sounds.close()
        if self.souvenirs is not None:
            self.souvenirs.close()
        self._report.close()
        self.show.close()
        glfw.destroy_window(self._window)
        glfw.terminate()

    def _delete_old_souvenirs(self, now: float) -> None:
        """Deletes old souvenirs periodically, even if this kiosk no longer makes any."""
        if now - self._swept_s >= _SWEEP_INTERVAL_S:
            self._swept_s = now
            self._store.delete_expired()

    def _fit_painter(self) -> Painter | None:
        """Returns a painter for the window's size, or None while the window has no pixels."""
        width, height = self.size
        if not width or not height:
            return None
        size = (height, width) if self._profile.screen.turn % 180 else (width, height)
        if self._painter is None or self._painter.size != size:
            if self._painter is not None:
                self._painter.release()
            self._painter = Painter(self._ctx, size, self._profile, self._settings)
        return self._painter

    def _handle_key(self, window: Any, key: int, code: int, action: int, modifiers: int) -> None:
        if action == glfw.PRESS:
            self.press(key, modifiers)

    def press(self, key: int, modifiers: int = 0) -> None:
        """Handles a pressed key of glfw. Escape and all other keys do nothing."""
        if key == glfw.KEY_Q and modifiers & QUIT_MODIFIERS == QUIT_MODIFIERS:
            self.is_closing = True
        elif key in KEY_PRESSES:
            self._presses.append(KEY_PRESSES[key])


def run_kiosk_window(profile: KioskProfile, folder: Path, seconds: float | None = None) -> None:
    """Opens the window of a kiosk and shows it until the program is ended.

    Args:
        folder: folder of the profile, for relative paths.
        seconds: close the window after this time; None to keep it open.

    Raises:
        ResourceError: if no screen exists, the monitor does not exist, OpenGL is missing, or another kiosk
            uses this screen.
        InputError: if the file of the viewer's settings is wrong, or no phone can open souvenirs.
    """
    check_souvenir_address(profile.souvenir, "souvenir")
    with contextlib.closing(ScreenLock(profile.screen.number)):
        set_language(find_language(profile.story.language))
        with contextlib.closing(KioskWindow(profile, folder)) as window:
            window.run(seconds)


_errors: deque[str] = deque(maxlen=20)
"""The newest messages of glfw."""


def _begin_glfw() -> None:
    """Starts glfw.

    Raises:
        ResourceError: without a screen.
    """
    glfw.set_error_callback(lambda code, text: _errors.append(decode_error(text)))
    if not glfw.init():
        raise ResourceError(
            f"no screen was found ({_errors[-1] if _errors else 'no reason given'})",
            where="kiosk",
            remedy="Start the kiosk in a graphical session, or on a console with cage.",
        )


def _find_place(profile: KioskProfile) -> _WindowPlacement:
    """Returns the position and size of the window on the profile's monitor.

    Raises:
        ResourceError: if the monitor does not exist.
    """
    monitors, screen = glfw.get_monitors(), profile.screen
    if screen.number >= len(monitors):
        names = ", ".join(decode_error(glfw.get_monitor_name(monitor)) for monitor in monitors) or "none"
        raise ResourceError(
            f"monitor {screen.number} does not exist. Connected monitors: {names}",
            where="kiosk",
            remedy="Connect the monitor, or change screen.number in the profile. The first monitor is 0.",
        )
    monitor = monitors[screen.number]
    mode, (x, y) = glfw.get_video_mode(monitor), glfw.get_monitor_pos(monitor)
    if not screen.size:
        return _WindowPlacement(monitor, x, y, (mode.size.width, mode.size.height), True)
    chosen = with_size(ViewerSettings(), screen.size)
    return _WindowPlacement(monitor, x, y, (chosen.width, chosen.height), False)


def _open_window(profile: KioskProfile, place: _WindowPlacement) -> Any:
    """Returns a window without a border.

    Raises:
        ResourceError: if it cannot be opened.
    """
    for hint, value in _window_hints(place):
        glfw.window_hint(hint, value)
    # GLFW disables the screensaver only for a full-screen window, so the window is created on a monitor.
    monitor = place.monitor if place.full else None
    window = glfw.create_window(*place.size, profile.name, monitor, None)
    if not window:
        raise ResourceError(
            f"the window cannot be opened ({_errors[-1] if _errors else 'no reason given'})",
            where="kiosk",
            remedy="Install a graphics driver that supports OpenGL 3.3.",
        )
    if not place.full:
        with contextlib.suppress(glfw.GLFWError):
            glfw.set_window_pos(window, place.x, place.y)
    return window


def _window_hints(place: _WindowPlacement) -> Iterator[tuple[int, int]]:
    """Yields the GLFW hints (hint, value) of the window."""
    mode = glfw.get_video_mode(place.monitor)
    yield glfw.CONTEXT_VERSION_MAJOR, 3
    yield glfw.CONTEXT_VERSION_MINOR, 3
    yield glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE
    yield glfw.OPENGL_FORWARD_COMPAT, True
    yield glfw.DECORATED, False
    yield glfw.RESIZABLE, False
    yield glfw.AUTO_ICONIFY, False
    yield glfw.SAMPLES, 0
    yield glfw.REFRESH_RATE, mode.refresh_rate


def _load_render_settings(profile: KioskProfile, folder: Path) -> RenderSettings:
    """Returns the viewer's render settings with those of the profile."""
    if not profile.screen.settings:
        return RenderSettings()
    return load_settings(ViewerSettings, folder / profile.screen.settings).render
