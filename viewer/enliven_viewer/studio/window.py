"""The studio's window: hello_imgui runs it, moderngl draws the picture behind its panels."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from imgui_bundle import hello_imgui, imgui
from imgui_bundle.glfw_utils import glfw_window_hello_imgui

from enliven.arrays import UInt8
from enliven.commands import parent_is_gone
from enliven.errors import ResourceError
from enliven_viewer.render import Scene
from enliven_viewer.render.gl import window_context
from enliven_viewer.settings import WindowStart
from enliven_viewer.studio.actions import KEYS, held_keys
from enliven_viewer.studio.desktop import Desktop
from enliven_viewer.studio.panels import (
    apply_style,
    draw_curves,
    draw_dialogs,
    draw_menu,
    draw_overlay,
    draw_side,
    draw_source,
    draw_timeline,
    draw_toolbar,
    load_fonts,
    split_side,
)
from enliven_viewer.studio.panels.examples import draw_examples, draw_performer, draw_strip
from enliven_viewer.studio.panels.outliner import draw_outliner, split_outliner
from enliven_viewer.studio.panels.stage import (
    draw_inset,
    draw_live,
    draw_perform,
    draw_rooms,
    draw_scan,
    draw_scan_over,
    draw_side_view,
    place_of_side_view,
)
from enliven_viewer.studio.perform import PerformerInset
from enliven_viewer.studio.performer import PerformerPicture, Thumbnails
from enliven_viewer.studio.picture import GlancePictures, Viewport
from enliven_viewer.studio.places import Area, Places, places_in
from enliven_viewer.studio.tools import MapTool, PaintTool
from enliven_viewer.studio.viewport import StandingCharacter
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.window import Place, is_minimised, toggle_full_screen

_LONGEST_STEP = 0.1
"""Seconds: after a longer picture the playhead goes on from where it was."""
_SAMPLES = 0
"""A pixel, of the window's own buffer; 8 where nothing is said. Panels smooth their edges themselves and the
picture behind them has its own samples, so that more would only take a third of the time of a picture."""


_WITHOUT: dict[str, tuple[str, ...]] = {
    "Perform": ("tools",),
    "Animate": (),
    "Model": ("timeline",),
    "Play": ("tools", "side"),
}
"""The panels that each workspace puts out of reach."""
_USUAL = WindowStart()
"""With panels, in a window, which asks before it throws work away."""
_MINIMISED_PAUSE = 0.05
"""Seconds of sleep a picture while the window is minimised and nothing of it is seen."""


class StudioWindow:
    """One window on a workspace.

    Args:
        workspace: what is edited.
        step: seconds that each picture takes, for films; None for the clock's.
        opening: how it begins.
    """

    def __init__(
        self, workspace: Workspace, step: float | None = None, opening: WindowStart = _USUAL
    ) -> None:
        self.workspace, self.step, self.opening = workspace, step, opening
        self.pace = 0.0  # pictures a second of late
        self._windowed: Place | None = None
        self.pictures = 0
        self._viewport: Viewport | None = None
        self._source: Viewport | None = None
        self._performer: PerformerPicture | None = None
        self._thumbnails: Thumbnails | None = None
        self._desktop: Desktop | None = None
        self._inset = PerformerInset()
        self._glances: GlancePictures | None = None
        self._screen: Any = None
        self._last = time.monotonic()
        self._framed = False

    def run(
        self,
        *,
        seconds: float | None = None,
        before: Callable[[StudioWindow], None] | None = None,
        after: Callable[[StudioWindow], None] | None = None,
        register_tests: Callable[[], None] | None = None,
    ) -> None:
        """Show the window until it is closed.

        Args:
            seconds: close it after so long.
            before, after: called before and after every picture, to give input and to take the picture.
            register_tests: scripted tests of the window, for ImGui's own test engine.
        """
        settings = self.workspace.editor.settings
        runner = hello_imgui.RunnerParams()
        runner.app_window_params.window_title = self.opening.title
        runner.app_window_params.window_geometry.size = (settings.width, settings.height)
        runner.app_window_params.restore_previous_geometry = False
        kinds = hello_imgui.DefaultImGuiWindowType
        runner.imgui_window_params.default_imgui_window_type = kinds.no_default_window
        runner.renderer_backend_options.open_gl_options.anti_aliasing_samples = _SAMPLES
        if self.opening.full_screen:
            mode = hello_imgui.FullScreenMode.full_screen_desktop_resolution
            runner.app_window_params.window_geometry.full_screen_mode = mode
        runner.fps_idling.enable_idling = False
        runner.ini_disable = True
        runner.dpi_aware_params.dpi_window_size_factor = 1.0  # the desktop's own scale is used
        calls = runner.callbacks
        calls.default_icon_font = hello_imgui.DefaultIconFont.font_awesome4
        calls.load_additional_fonts = load_fonts
        calls.setup_imgui_style = apply_style
        calls.post_init = self._start
        calls.custom_background = self._picture
        calls.show_gui = self._gui
        calls.confirm_exit = self._may_close
        if register_tests is not None:
            runner.use_imgui_test_engine = True
            calls.register_tests = register_tests
        end = None if seconds is None else time.monotonic() + seconds

        def first() -> None:
            if parent_is_gone() or (end is not None and time.monotonic() > end):
                self.close()
            if is_minimised(glfw_window_hello_imgui()):
                time.sleep(_MINIMISED_PAUSE)
            runner.fps_idling.enable_idling = register_tests is None and before is None and self._idle
            if before is not None:
                before(self)

        def last() -> None:
            self.pictures += 1
            if after is not None:
                after(self)

        calls.pre_new_frame, calls.before_swap = first, last
        calls.post_new_frame = lambda: self._desktop.lay_out() if self._desktop else None
        try:
            hello_imgui.run(runner)
        except RuntimeError as error:
            self.workspace.store.autosave_now()
            if self.pictures:
                raise
            mend = "Use --film out.mp4 to render without a window, or start where there is a display."
            raise ResourceError(str(error).rstrip("."), where="window", mend=mend) from None
        except BaseException:
            self.workspace.perform.recording.stop()
            self.workspace.store.autosave_now()
            raise
        finally:
            self.workspace.sound.stop()
            self.workspace.perform.disconnect()

    def close(self) -> None:
        """Close the window after this picture."""
        hello_imgui.get_runner_params().app_shall_exit = True

    def _may_close(self) -> bool:
        """Whether the window's own button may close it; with unsaved work a dialogue opens instead."""
        self.workspace.ask("quit")
        return self.workspace.ended

    def pixels(self) -> UInt8:
        """(H, W, 3) sRGB of the screen, top row first; to be called after a picture."""
        assert self._viewport is not None
        width, height = self._framebuffer_size()
        raw = self._screen.read(viewport=(0, 0, width, height), components=3, alignment=1)
        _ = self._viewport.renderer.ctx.error  # moderngl asks a window for buffers that it lacks
        return np.ascontiguousarray(np.frombuffer(raw, np.uint8).reshape(height, width, 3)[::-1])

    @property
    def places(self) -> Places:
        """The layout of the panels at the window's size."""
        size = imgui.get_io().display_size
        room = self.workspace.perform.room
        without = ("menu", "tools", "side", "timeline") if self.opening.bare else _WITHOUT[room]
        if room == "Play" and self.workspace.perform.live is not None:
            without = (*without, "timeline")  # the live one is drawn over the picture
        how = {"puppet": self._edits_puppet, "curves": self.workspace.curves.on}
        return places_in(size.x, size.y, without=without, **how)

    @property
    def _idle(self) -> bool:
        """Whether nothing moves, so that few pictures a second are enough."""
        perform, editor = self.workspace.perform, self.workspace.editor
        still = perform.live is None or perform.live.quiet
        return still and not editor.playing and perform.recording.phase == "idle" and self.step is None

    @property
    def _edits_puppet(self) -> bool:
        """Whether a puppet is edited; its performer and its key poses are shown then."""
        return (
            self.workspace.puppets.puppet is not None
            and self.workspace.perform.room in ("Animate", "Model")
            and not isinstance(self.workspace.input.tool, (MapTool, PaintTool))
            and not self.workspace.editor.selection.several
        )

    @property
    def _hides_live(self) -> bool:
        """Whether what is live is hidden by its eye, which holds outside performing."""
        return self.workspace.outliner.live_hidden and self.workspace.perform.room in ("Animate", "Model")

    def _start(self) -> None:
        # Keys are the tools': Space must not press the button that was clicked last.
        imgui.get_io().config_flags &= ~imgui.ConfigFlags_.nav_enable_keyboard
        settings = self.workspace.editor.settings
        context = window_context()
        self._screen = context.detect_framebuffer()  # now, while the window's own is bound
        self._viewport = Viewport(context, (64, 64), settings.render)
        self._viewport.renderer.textures.beside = self.step is None  # films wait for every picture
        self._source = Viewport(context, (64, 64), settings.render)
        self._performer = PerformerPicture(self._source.renderer)
        self._thumbnails = Thumbnails(context, self.workspace.puppets.stage.surfaces)
        self._desktop = Desktop(self.workspace)
        self._glances = GlancePictures(context)

    def _framebuffer_size(self) -> tuple[int, int]:
        io = imgui.get_io()
        scale = io.display_framebuffer_scale
        return round(io.display_size.x * scale.x), round(io.display_size.y * scale.y)

    def _picture(self) -> None:
        """Draw the 3-D picture in the middle of the window."""
        assert self._viewport is not None
        now = time.monotonic()
        elapsed = min(now - self._last, _LONGEST_STEP) if self.step is None else self.step
        self._last = now
        editor, area = self.workspace.editor, self.places.viewport
        editor.size = (area.width, area.height)
        if not self._framed:
            self._framed = True
            editor.frame_all(at_once=True)
        self.pace += (1 / max(elapsed, 1e-3) - self.pace) * min(elapsed * 2, 1.0)
        editor.advance(elapsed)
        perform = self.workspace.perform
        perform.advance(elapsed)
        self.workspace.sound.follow()
        scan = self.workspace.scan
        scan.advance()
        self._draw_source()
        scale = imgui.get_io().display_framebuffer_scale.y
        size = max(round(area.width * scale), 1), max(round(area.height * scale), 1)
        renderer = self._viewport.renderer
        renderer.look = editor.look
        renderer.resize(size)
        stage = [one for one in editor.seen if one.id not in perform.hidden and not scan.active]
        live = None if self._hides_live else scan.beside(perform.scene)
        self._draw_side(stage, live)
        self._viewport.draw(
            stage,
            editor.lens,
            editor.selection,
            self.workspace.input.tool.overlay(),
            over=self.workspace.input.tool.picture(),
            ghosts=self.workspace.ghosts.picture(),
            meshes=editor.show_meshes,
            bones=editor.show_bones and perform.room in ("Animate", "Model"),
            live=live,
            growing=scan.surface,
        )
        bottom = self._framebuffer_size()[1] - round((area.y + area.height) * scale)
        renderer.present(self._screen, (round(area.x * scale), bottom))
        self._screen.viewport = (0, 0, *self._framebuffer_size())

    def _draw_source(self) -> None:
        """Draw the take while motion is mapped, or the performer while a puppet is edited."""
        tool = self.workspace.input.tool
        if self._edits_puppet:
            self._draw_performer()
            return
        posed = tool.source.posed() if isinstance(tool, MapTool) else None
        if not isinstance(tool, MapTool) or posed is None or self._source is None:
            return
        scale = imgui.get_io().display_framebuffer_scale.y
        wide, high = tool.source.size
        self._source.renderer.resize((max(round(wide * scale), 1), max(round(high * scale), 1)))
        self._source.draw([posed], tool.source.lens, tool.source.selection, tool.source.overlay())

    def _draw_side(self, stage: Sequence[StandingCharacter], live: Scene | None) -> None:
        """Draw the limb that is about to be held from the side; performing needs no picture of a take."""
        place = place_of_side_view(self.workspace, self.places.viewport)
        lens = self.workspace.perform.close_up.lens(place.width, place.height)
        if lens is None or self._source is None:
            return
        scale = imgui.get_io().display_framebuffer_scale.y
        self._source.renderer.look = self.workspace.editor.look
        self._source.renderer.resize(
            (max(round(place.width * scale), 1), max(round(place.height * scale), 1))
        )
        selection = self.workspace.editor.selection
        self._source.draw(stage, lens, selection, self.workspace.input.tool.overlay(), bones=False, live=live)

    def _draw_performer(self) -> None:
        view = self.workspace.performer
        view.follow()
        if self._thumbnails is not None:
            self._thumbnails.work()
        figure = view.figure()
        if figure is not None and self._performer is not None:
            scale = imgui.get_io().display_framebuffer_scale.y
            wide, high = view.size
            self._performer.renderer.resize((max(round(wide * scale), 1), max(round(high * scale), 1)))
            self._performer.draw(figure, view.lens, view.paired(), view.hovered)

    def _gui(self) -> None:
        """Draw the panels, and pass the input beside them to the viewport."""
        places = self.places
        if not self.opening.bare:
            self._panels(places)
            if not self._hides_live and self._glances is not None:
                draw_inset(self.workspace, places.viewport, self._inset, self._glances)
            if self.workspace.perform.close_up.box is not None and self._source is not None:
                draw_side_view(self.workspace, places.viewport, self._source.renderer.picture.texture.glo)
            draw_live(self.workspace, places.viewport, self.pace)
            draw_scan_over(self.workspace, places.viewport)
        asking = self.workspace.asking  # Escape closes the dialogue, and not what is behind it as well
        draw_dialogs(self.workspace)
        self._listen(places.viewport, keys=not asking)
        self.workspace.store.autosave()
        if self._desktop is not None:
            self._desktop.follow()
        if self.workspace.ended:
            self.workspace.store.close()
            self.close()

    def _panels(self, places: Places) -> None:
        """Draw the menu and the panels of the workspace."""
        room = self.workspace.perform.room
        draw_menu(self.workspace)
        draw_rooms(self.workspace)
        if places.tools.width:
            draw_toolbar(self.workspace, places.tools)
        if room == "Perform" and self.workspace.scan.shown:
            draw_scan(self.workspace, places.side)
        elif room == "Perform":
            draw_perform(self.workspace, places.side)
        elif places.side.width:
            self._side(places)
        if places.timeline.height:
            draw_timeline(self.workspace, places.timeline)
        if places.curves is not None:
            draw_curves(self.workspace, places.curves)
        draw_overlay(self.workspace, places.viewport, tool=room in ("Animate", "Model"))

    def _side(self, places: Places) -> None:
        """Draw the outliner, and below it what is chosen."""
        tool, column = self.workspace.input.tool, places.side
        if isinstance(tool, MapTool) and self._source is not None:
            column, below = split_side(column)
            texture = self._source.renderer.picture.texture.glo
            draw_source(self.workspace, tool, below, places.viewport, texture)
        above, below = split_outliner(column, self.workspace.outliner.share)
        chosen = self.workspace.editor.selection
        if chosen.character is None or (column is not places.side and chosen.layer is None):
            above = column  # nothing is chosen, or there is no room for more than the tree and the source
        elif places.performer is None:
            draw_side(self.workspace, below)
        draw_outliner(self.workspace, above, column)
        if places.performer is not None and self._performer is not None:
            texture = self._performer.renderer.picture.texture.glo
            draw_performer(self.workspace, places.performer, texture)
            draw_examples(self.workspace, below)
            if places.strip is not None and self._thumbnails is not None:
                draw_strip(self.workspace, places.strip, self._thumbnails)

    def _listen(self, area: Area, *, keys: bool = True) -> None:
        """Passes pointer, buttons, wheel and keys over the viewport on."""
        io, user_input = imgui.get_io(), self.workspace.input
        at = (io.mouse_pos.x - area.x, io.mouse_pos.y - area.y)
        held: dict[str, Any] = {"shift": io.key_shift, "ctrl": io.key_ctrl}
        free = area.holds(io.mouse_pos.x, io.mouse_pos.y) and not io.want_capture_mouse
        spot = (io.mouse_pos.x, io.mouse_pos.y)
        for x, y in self._desktop.path.take(spot) if self._desktop is not None else [spot]:
            passed = (x - area.x, y - area.y)
            if passed != user_input.at and (free or user_input.busy):
                user_input.move(passed, **held)
        for button in (0, 1, 2):
            if free and imgui.is_mouse_clicked(button):
                user_input.press(at, button, **held)
            if user_input.busy and imgui.is_mouse_released(button):
                user_input.release(at, button, **held)
        if free and io.mouse_wheel:
            user_input.wheel(io.mouse_wheel)
        if keys and not io.want_text_input and not self.workspace.asking:
            modifiers = held_keys()
            for name, key in KEYS.items():
                if imgui.is_key_pressed(key, repeat=name in ("left", "right")):
                    self._key(modifiers + name)

    def _key(self, key: str) -> None:
        """Do what a key means: of the window itself, or of the workspace."""
        if key == "f11":
            self._windowed = toggle_full_screen(glfw_window_hello_imgui(), self._windowed)
        elif (
            key == "escape" and self.opening.escape_ends and self.workspace.perform.recording.phase == "idle"
        ):
            self.workspace.ask("quit")
        else:
            self.workspace.input.key(key)
