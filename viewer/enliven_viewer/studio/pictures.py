"""The pictures of a window: the stage in the middle, and what its panels show of takes and performers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from imgui_bundle import imgui

from enliven.arrays import UInt8
from enliven_viewer.render import Scene
from enliven_viewer.render.gl import window_context
from enliven_viewer.studio.panels.stage import place_of_side_view
from enliven_viewer.studio.performer import PerformerPicture, Thumbnails
from enliven_viewer.studio.picture import GlancePictures, Viewport
from enliven_viewer.studio.places import Area
from enliven_viewer.studio.tools import MapTool, PaintTool
from enliven_viewer.studio.viewport import StandingCharacter
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import look_in_theme


class WindowPictures:
    """Draws into the window that is bound when it is made.

    Args:
        films: every picture is waited for, whatever it takes.

    Attributes:
        source: draws the take that motion is mapped from, or a limb from the side.
        performer: draws the performer of a puppet that is edited.
        thumbnails: draws key poses.
        glances: draws what the cameras of performers see.
    """

    def __init__(self, workspace: Workspace, *, films: bool) -> None:
        self.workspace = workspace
        settings, context = workspace.editor.settings, window_context()
        self._screen: Any = context.detect_framebuffer()  # now, while the window's own is bound
        self.viewport = Viewport(context, (64, 64), settings.render)
        self.viewport.renderer.textures.beside = not films
        self.source = Viewport(context, (64, 64), settings.render)
        self.performer = PerformerPicture(self.source.renderer)
        self.thumbnails = Thumbnails(context, workspace.puppets.stage.surfaces)
        self.glances = GlancePictures(context)

    def pixels(self) -> UInt8:
        """Returns (H, W, 3) sRGB of the screen, top row first; to be called after a picture."""
        width, height = _framebuffer_size()
        raw = self._screen.read(viewport=(0, 0, width, height), components=3, alignment=1)
        _ = self.viewport.renderer.ctx.error  # moderngl asks a window for buffers that it lacks
        return np.ascontiguousarray(np.frombuffer(raw, np.uint8).reshape(height, width, 3)[::-1])

    def draw(self, area: Area) -> None:
        """Draws the stage in a part of the window, and what the panels show."""
        workspace = self.workspace
        editor, perform, scan = workspace.editor, workspace.perform, workspace.scan
        self.source.renderer.look = look_in_theme("studio")
        self._draw_source()
        renderer = self.viewport.renderer
        renderer.look = look_in_theme(editor.look)
        renderer.resize(_dense(area.width, area.height))
        stage = [one for one in editor.seen if one.id not in perform.hidden and not scan.active]
        live = None if hides_live(workspace) else scan.beside(perform.scene)
        self._draw_side(area, stage, live)
        tool = workspace.input.tool
        self.viewport.draw(
            stage,
            editor.lens,
            editor.selection,
            tool.overlay(),
            over=tool.picture(),
            ghosts=workspace.ghosts.picture(),
            meshes=editor.show_meshes,
            bones=editor.show_bones and perform.room in ("Animate", "Model"),
            live=live,
            growing=scan.surface,
        )
        wide, high = _framebuffer_size()
        scale = imgui.get_io().display_framebuffer_scale.y
        renderer.present(self._screen, (round(area.x * scale), high - round((area.y + area.height) * scale)))
        self._screen.viewport = (0, 0, wide, high)

    def _draw_source(self) -> None:
        """Draws the take while motion is mapped, or the performer while a puppet is edited."""
        tool = self.workspace.input.tool
        if edits_puppet(self.workspace):
            self._draw_performer()
            return
        posed = tool.source.posed() if isinstance(tool, MapTool) else None
        if isinstance(tool, MapTool) and posed is not None:
            self.source.renderer.resize(_dense(*tool.source.size))
            self.source.draw([posed], tool.source.lens, tool.source.selection, tool.source.overlay())

    def _draw_side(self, area: Area, stage: Sequence[StandingCharacter], live: Scene | None) -> None:
        """Draws the limb that is about to be held from the side; performing needs no picture of a take."""
        workspace = self.workspace
        place = place_of_side_view(workspace, area)
        lens = workspace.perform.close_up.lens(place.width, place.height)
        if lens is None:
            return
        self.source.renderer.look = look_in_theme(workspace.editor.look)
        self.source.renderer.resize(_dense(place.width, place.height))
        chosen, overlay = workspace.editor.selection, workspace.input.tool.overlay()
        self.source.draw(stage, lens, chosen, overlay, bones=False, live=live)

    def _draw_performer(self) -> None:
        """Draws the performer of the puppet, and key poses that were asked for."""
        view = self.workspace.performer
        view.follow()
        self.thumbnails.work()
        figure = view.figure()
        if figure is not None:
            self.performer.renderer.resize(_dense(*view.size))
            self.performer.draw(figure, view.lens, view.paired(), view.hovered)


def edits_puppet(workspace: Workspace) -> bool:
    """Returns True if a puppet is edited; its performer and its key poses are shown then."""
    return (
        workspace.puppets.puppet is not None
        and workspace.perform.room in ("Animate", "Model")
        and not isinstance(workspace.input.tool, (MapTool, PaintTool))
        and not workspace.editor.selection.several
    )


def hides_live(workspace: Workspace) -> bool:
    """Returns True if what is live is hidden by its eye, which holds outside performing."""
    return workspace.outliner.live_hidden and workspace.perform.room in ("Animate", "Model")


def _dense(wide: float, high: float) -> tuple[int, int]:
    """Returns pixels of the screen for a width and height in usual ones, one at least."""
    scale = imgui.get_io().display_framebuffer_scale.y
    return max(round(wide * scale), 1), max(round(high * scale), 1)


def _framebuffer_size() -> tuple[int, int]:
    """Returns pixels of the screen that the window has."""
    io = imgui.get_io()
    scale = io.display_framebuffer_scale
    return round(io.display_size.x * scale.x), round(io.display_size.y * scale.y)
