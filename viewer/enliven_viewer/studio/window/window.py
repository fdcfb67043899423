"""The studio's window: hello_imgui runs it, and moderngl draws the 3D view behind its panels."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from imgui_bundle import hello_imgui, imgui
from imgui_bundle.glfw_utils import glfw_window_hello_imgui

from enliven.arrays import UInt8
from enliven.errors import ResourceError
from enliven.supervision.lifetime import parent_is_gone
from enliven_viewer.settings import WindowStart
from enliven_viewer.studio.actions.imgui_keys import KEYS, find_held_modifiers
from enliven_viewer.studio.app.contributions import Frame
from enliven_viewer.studio.app.panel_layout import Area, PanelLayout
from enliven_viewer.studio.app.style import apply_colours, apply_style, load_fonts
from enliven_viewer.studio.panels.dialogs import draw_dialogs
from enliven_viewer.studio.window.desktop import Desktop
from enliven_viewer.studio.window.live_outputs import WindowOutputs
from enliven_viewer.studio.window.panel_drawing import draw_panels, make_panel_layout
from enliven_viewer.studio.window.window_pictures import WindowPictures
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import get_theme
from enliven_viewer.window import WindowRectangle, is_minimised, toggle_full_screen

_MAX_STEP_S = 2.0
"""Maximum time step in seconds. The playhead follows the clock even at low frame rates. After a longer pause,
for example of a suspended computer, it continues from its last position.
"""
_FRAMEBUFFER_SAMPLES = 0
"""Samples per pixel of the window's framebuffer. ImGui's default is 8. Panels smooth their edges without
multisampling, and the 3D view has a separate multisampled framebuffer. More samples would cost a third of the
frame time.
"""


_DEFAULT_CORNER = (80, 80)
"""Position in pixels from the screen's corner of a window that was started in full screen and leaves it."""
_DEFAULT_START = WindowStart()
"""Default start options: a window with panels, which asks before unsaved work is lost."""
_MINIMISED_SLEEP_S = 0.05
"""Sleep per frame in seconds while the window is minimised."""


def measure_elapsed(last: float, now: float) -> float:
    """Returns the time step in seconds between two frames at given clock times."""
    return min(now - last, _MAX_STEP_S)


class StudioWindow:
    """One window on a workspace.

    Args:
        workspace: the workspace to edit.
        step: fixed duration of each frame in seconds, for films. None uses the clock.
        opening: the start options.
        outputs: live outputs, which send the shown motion to other programs; None if there are none. The
            caller closes them.
    """

    def __init__(
        self,
        workspace: Workspace,
        step: float | None = None,
        opening: WindowStart = _DEFAULT_START,
        outputs: WindowOutputs | None = None,
    ) -> None:
        self.workspace, self.step, self.opening = workspace, step, opening
        self._outputs = outputs
        self.pace = 0.0  # Smoothed frame rate in frames per second.
        # Rectangle of the window that F11 restores. A window that starts in full screen has no earlier
        # rectangle, so it gets a default.
        settings = workspace.editor.settings
        self._window_rectangle: WindowRectangle | None = (
            (*_DEFAULT_CORNER, settings.width, settings.height) if opening.full_screen else None
        )
        self.pictures = 0
        self._pictures: WindowPictures | None = None
        self.desktop: Desktop | None = None
        self._last_frame_s = time.monotonic()
        self._has_framed = False
        self._theme = get_theme()[0]

    def run(
        self,
        *,
        seconds: float | None = None,
        before: Callable[[StudioWindow], None] | None = None,
        after: Callable[[StudioWindow], None] | None = None,
        register_tests: Callable[[], None] | None = None,
    ) -> None:
        """Shows the window until it is closed.

        Args:
            seconds: close the window after this time.
            before, after: called before and after every frame, for example to inject input or to capture the
                image.
            register_tests: registers scripted tests of the window with ImGui's test engine.
        """
        runner = self._make_runner(register_tests)
        end = None if seconds is None else time.monotonic() + seconds
        may_idle = register_tests is None and before is None

        def start_frame() -> None:
            if parent_is_gone() or (end is not None and time.monotonic() > end):
                self.close()
            if is_minimised(glfw_window_hello_imgui()):
                time.sleep(_MINIMISED_SLEEP_S)
            runner.fps_idling.enable_idling = may_idle and self._idle
            if self._theme != get_theme()[0]:
                self._theme = get_theme()[0]
                apply_colours()
            if before is not None:
                before(self)

        def end_frame() -> None:
            self.pictures += 1
            if after is not None:
                after(self)

        runner.callbacks.pre_new_frame, runner.callbacks.before_swap = start_frame, end_frame
        try:
            self._run_until_closed(runner)
        finally:
            # One of the tasks turns a running recording into an edit.
            for stop in reversed(self.workspace.closing_tasks):
                stop()
            if not self.workspace.ended:
                # Write a recovery file, because the user was not asked whether to save.
                self.workspace.store.autosave_now()

    def _make_runner(self, register_tests: Callable[[], None] | None) -> hello_imgui.RunnerParams:
        """Returns the settings and the callbacks of the window, except those at start and end of a frame."""
        settings = self.workspace.editor.settings
        runner = hello_imgui.RunnerParams()
        runner.app_window_params.window_title = self.opening.title
        runner.app_window_params.window_geometry.size = (settings.width, settings.height)
        runner.app_window_params.restore_previous_geometry = False
        kinds = hello_imgui.DefaultImGuiWindowType
        runner.imgui_window_params.default_imgui_window_type = kinds.no_default_window
        runner.renderer_backend_options.open_gl_options.anti_aliasing_samples = _FRAMEBUFFER_SAMPLES
        if self.opening.full_screen:
            mode = hello_imgui.FullScreenMode.full_screen_desktop_resolution
            runner.app_window_params.window_geometry.full_screen_mode = mode
        runner.fps_idling.enable_idling = False
        runner.ini_disable = True
        # Do not let ImGui scale the window, because Desktop does.
        runner.dpi_aware_params.dpi_window_size_factor = 1.0
        calls = runner.callbacks
        calls.default_icon_font = hello_imgui.DefaultIconFont.font_awesome4
        calls.load_additional_fonts = load_fonts
        calls.setup_imgui_style = apply_style
        calls.post_init = self._start
        calls.custom_background = self._draw_picture
        calls.show_gui = self._draw_gui
        calls.confirm_exit = self.confirm_close
        if register_tests is not None:
            runner.use_imgui_test_engine = True
            calls.register_tests = register_tests
        calls.post_new_frame = lambda: self.desktop.lay_out() if self.desktop else None
        return runner

    def _run_until_closed(self, runner: hello_imgui.RunnerParams) -> None:
        """Shows the window. If an error ends it, saves a recovery file.

        Raises:
            ResourceError: if the window cannot be opened.
        """
        try:
            hello_imgui.run(runner)
        except RuntimeError as error:
            self.workspace.store.autosave_now()
            if self.pictures:
                raise
            remedy = "Use --film out.mp4 to render without a window, or start on a computer with a display."
            raise ResourceError(str(error).rstrip("."), where="window", remedy=remedy) from None
        except BaseException:
            self.workspace.recording.stop()
            self.workspace.store.autosave_now()
            raise

    def close(self) -> None:
        """Closes the window after this frame."""
        hello_imgui.get_runner_params().app_shall_exit = True

    def confirm_close(self) -> bool:
        """Returns True if the window's close button may close it.

        With unsaved work, a dialogue opens instead.
        """
        self.workspace.quit()
        return self.workspace.ended

    def pixels(self) -> UInt8:
        """Returns (H, W, 3) sRGB of the screen, top row first. Call after a frame."""
        assert self._pictures is not None
        return self._pictures.pixels()

    @property
    def gl_error(self) -> str:
        """Returns the name of the OpenGL error since the last call; "GL_NO_ERROR" if there was none."""
        assert self._pictures is not None
        return str(self._pictures.viewport.renderer.ctx.error)

    @property
    def places(self) -> PanelLayout:
        """Returns the layout of the panels at the window's size."""
        return make_panel_layout(self.workspace, bare=self.opening.bare or self.audience)

    @property
    def audience(self) -> bool:
        """Returns True if the window fills a screen for an audience, so that only the
        performance is shown.
        """
        return self.opening.audience and self._window_rectangle is not None

    @property
    def _idle(self) -> bool:
        """Returns True if nothing moves, so that a low frame rate is enough."""
        is_active = any(check() for check in self.workspace.activity_checks)
        return not is_active and not self.workspace.editor.playing and self.step is None

    def _start(self) -> None:
        # Turn off ImGui's keyboard navigation. The keys belong to the tools, and Space must not press the
        # button that was clicked last.
        imgui.get_io().config_flags &= ~imgui.ConfigFlags_.nav_enable_keyboard
        self._pictures = WindowPictures(self.workspace, films=self.step is not None)
        self.desktop = Desktop(self.workspace)

    def _draw_picture(self) -> None:
        """Advances time, and draws the 3D view in the middle of the window."""
        now = time.monotonic()
        elapsed = measure_elapsed(self._last_frame_s, now) if self.step is None else self.step
        self._last_frame_s = now
        workspace, area = self.workspace, self.places.viewport
        editor = workspace.editor
        editor.size = (area.width, area.height)
        if not self._has_framed:
            self._has_framed = True
            editor.frame_all(at_once=True)
        self.pace += (1 / max(elapsed, 1e-3) - self.pace) * min(elapsed * 2, 1.0)
        editor.advance(elapsed)
        is_unattended = self.opening.audience and (self.opening.bare or self.audience)
        workspace.frame = Frame(elapsed, self.pace, area, is_unattended)
        for task in workspace.frame_tasks:
            task()
        assert self._pictures is not None
        self._pictures.draw(area)
        if self._outputs is not None:
            self._outputs.send()

    def _draw_gui(self) -> None:
        """Draws the panels, and passes input outside of them to the viewport."""
        places = self.places
        if self.audience and not self.opening.bare:
            for draw in self.workspace.audience_overlays:
                draw(places.viewport)
        elif not self.opening.bare:
            draw_panels(self.workspace, places)
            for overlay in self.workspace.overlays:
                overlay.draw(places.viewport)
        # Read this before the dialogue is drawn, so that Escape only closes the dialogue.
        asking = self.workspace.asking
        draw_dialogs(self.workspace)
        if not (self.audience or self.opening.bare):
            for draw_above in self.workspace.window_overlays:
                draw_above(places)
        if not any(is_blocked() for is_blocked in self.workspace.input_blocks):
            self._handle_input(places.viewport, keys=not asking)
        self.workspace.store.autosave()
        if self.desktop is not None:
            self.desktop.update()
        if self.workspace.ended:
            self.workspace.store.close()
            self.close()

    def _handle_input(self, area: Area, *, keys: bool = True) -> None:
        """Passes pointer, buttons, wheel and keys over the viewport to the tools."""
        io, user_input = imgui.get_io(), self.workspace.input
        pixel = (io.mouse_pos.x - area.x, io.mouse_pos.y - area.y)
        held: dict[str, Any] = {"shift": io.key_shift, "ctrl": io.key_ctrl}
        is_over_view = area.contains(io.mouse_pos.x, io.mouse_pos.y) and not io.want_capture_mouse
        spot = (io.mouse_pos.x, io.mouse_pos.y)
        is_finger, path = False, [spot]
        if self.desktop is not None:
            path = self.desktop.path.take_positions(spot)
            is_finger = self.desktop.fingers.update(
                path,
                is_pressed=imgui.is_mouse_clicked(0),
                is_held=imgui.is_mouse_down(0) or imgui.is_mouse_released(0),
                is_touch_screen=io.mouse_source == imgui.MouseSource.touch_screen,
            )
        for x, y in path:
            passed = (x - area.x, y - area.y)
            if passed != user_input.at and (is_over_view or user_input.busy):
                user_input.move(passed, **held)
        for button in (0, 1, 2):
            if is_over_view and imgui.is_mouse_clicked(button):
                user_input.press(pixel, button, is_finger=is_finger, **held)
            if user_input.busy and imgui.is_mouse_released(button):
                user_input.release(pixel, button, **held)
        if is_over_view and io.mouse_wheel:
            user_input.wheel(io.mouse_wheel)
        if keys and not io.want_text_input and not self.workspace.asking:
            modifiers = find_held_modifiers()
            for name, key in KEYS.items():
                if imgui.is_key_pressed(key, repeat=name in ("left", "right")):
                    self._handle_key(modifiers + name)

    def _handle_key(self, key: str) -> None:
        """Handles a key, first for the window itself, then for the workspace."""
        if key == "f11":
            self._window_rectangle = toggle_full_screen(glfw_window_hello_imgui(), self._window_rectangle)
        elif key == "escape" and self.opening.escape_ends and self.workspace.recording.phase == "idle":
            self.workspace.quit()
        else:
            self.workspace.input.key(key)
