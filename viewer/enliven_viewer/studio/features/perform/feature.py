"""Registers performing: the link to a stage, its actions, and the Perform panel."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from enliven_viewer.language import later
from enliven_viewer.live.idle_loop import IdleLoop
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.contributions import FileDialog, LiveStageView, Panel, ViewOverlay
from enliven_viewer.studio.app.panel_layout import HOLDER_LINE_HEIGHT, Area
from enliven_viewer.studio.features.perform.actions import make_perform_actions
from enliven_viewer.studio.features.perform.preview_placement import PreviewPlacement
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.viewport.preview_textures import PreviewTextures
from enliven_viewer.studio.viewport.viewport import Viewport
from enliven_viewer.theme import look_in_theme

_RECORDING_SUFFIXES = (".mcap", ".bvh", ".txt")
"""File types that a stage on this machine can play: camera recordings and motion capture."""
_LIVE_TIMELINE_HEIGHT = 56.0
"""Height in pixels of the live timeline at the bottom of the view in the Play workspace."""


def register(app: App) -> None:
    """Registers performing."""
    perform = app.add_state(PerformSession(app.editor, app.folder, app.tabs))
    stage = app.add_state(StageOverlays(app, perform))

    # The drawing module is imported late, so that a workspace without a window works without ImGui.
    def draw_panel(area: Area) -> None:
        from enliven_viewer.studio.features.perform.panel import draw_perform

        draw_perform(app, area)

    def play_file(path: Path) -> None:
        perform.connect_local("--loop", "--recording", str(path))

    app.actions.add(*make_perform_actions(perform))
    app.actions.workspace = lambda: perform.shortcut_workspace
    app.panels.append(Panel("perform", draw_panel, workspaces=("Perform",)))
    app.live = LiveStageView(
        lambda: None if perform.hides_live else perform.scene,
        lambda: perform.hidden,
        lambda: frozenset(() if perform.live is None else perform.live.held),
        stage.put,
    )
    app.recording = perform.recording
    app.panel_pictures.append(stage.make_pictures)
    app.overlays.append(ViewOverlay(stage.draw, find_lines_height=stage.find_lines_height))
    app.audience_overlays.append(stage.draw_audience)
    app.hidden_panels.append(lambda: ("timeline",) if stage.has_timeline else ())
    title = later("Play a recording on the stage")
    app.file_dialogs["perform"] = FileDialog(title, _RECORDING_SUFFIXES, play_file)
    app.frame_tasks.append(stage.advance)
    app.activity_checks.append(stage.is_moving)
    app.closing_tasks.append(perform.disconnect)


class StageOverlays:
    """The live stage in the window: images and text over the view, and the idle loop for an audience.

    The drawing modules are imported late, so that a workspace without a window works without ImGui.

    Attributes:
        idle_loop: replays the last performance to an audience while the edge is lost.
    """

    def __init__(self, app: App, perform: PerformSession) -> None:
        self._app, self._perform = app, perform
        self.idle_loop = IdleLoop()
        self._placement = PreviewPlacement()
        self._view: Viewport | None = None
        self._textures: PreviewTextures | None = None

    @property
    def has_timeline(self) -> bool:
        """Returns True if the timeline of the live stage is drawn over the view."""
        return self._app.tabs.active == "Play" and self._perform.live is not None

    def put(self, name: str) -> None:
        """Puts a character on the stage, or on the next connected stage, and shows the Perform workspace."""
        self._app.tabs.active = "Perform"
        self._perform.staged.put_when_ready(name)

    def advance(self) -> None:
        """Advances the link to the stage, and the idle loop. Call once per frame."""
        app, frame = self._app, self._app.frame
        self._perform.advance(frame.elapsed_s)
        if frame.plays_to_audience:
            orbits = not app.preferences.less_motion
            self.idle_loop.advance(self._perform.live, app.editor.camera, frame.elapsed_s, orbits=orbits)

    def is_moving(self) -> bool:
        """Returns True while the stage moves, is lost, or is recorded."""
        live = self._perform.live
        is_live = live is not None and not live.is_quiet
        return is_live or bool(self.idle_loop.loss) or self._perform.recording.phase != "idle"

    def find_lines_height(self) -> float:
        """Returns the height in pixels of the live timeline and of the lines about performers."""
        perform = self._perform
        height = _LIVE_TIMELINE_HEIGHT if self.has_timeline else 0.0
        if self._app.tabs.active in ("Perform", "Play"):
            # Include the line with the condition for which Possess waits.
            height += HOLDER_LINE_HEIGHT * (len(perform.holders) + perform.possession_requests.is_waiting)
        return height

    def make_pictures(self, view: Viewport) -> Callable[[], object]:
        """Returns the function that draws the side view of the limb that the next possession attaches."""
        from enliven_viewer.studio.app.style import convert_to_screen_pixels
        from enliven_viewer.studio.features.perform.camera_preview import find_side_view_area

        app, self._view, self._textures = self._app, view, PreviewTextures(view.renderer.ctx)

        def draw() -> None:
            place = find_side_view_area(app, app.frame.view)
            lens = self._perform.close_up.lens(place.width, place.height)
            if lens is None:
                return
            view.renderer.look = look_in_theme(app.editor.look)
            view.renderer.resize(convert_to_screen_pixels(place.width, place.height))
            chosen, overlay = app.editor.selection, app.input.tool.overlay()
            view.draw(app.shown_characters, lens, chosen, overlay, bones=False, live=app.shown_scene)

        return draw

    def draw(self, area: Area) -> None:
        """Draws the camera previews, the side view, and the text about the stage."""
        from enliven_viewer.studio.features.perform.camera_preview import draw_camera_previews, draw_side_view
        from enliven_viewer.studio.features.perform.live_texts import draw_live

        app = self._app
        if not self._perform.hides_live and self._textures is not None:
            draw_camera_previews(app, area, self._placement, self._textures)
        if self._perform.close_up.box is not None and self._view is not None:
            draw_side_view(app, area, self._view.renderer.picture.texture.glo)
        draw_live(app, area, app.frame.rate_hz)

    def draw_audience(self, area: Area) -> None:
        """Draws the text for an audience."""
        from enliven_viewer.studio.features.perform.live_texts import draw_audience

        draw_audience(self._app, area, self.idle_loop.audience_text)
