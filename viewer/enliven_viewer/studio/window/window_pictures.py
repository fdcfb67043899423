"""Renders the images of a window: the stage, and the panels' images of takes and performers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from imgui_bundle import imgui

from enliven.arrays import UInt8
from enliven_viewer.render.gl.context import get_window_context
from enliven_viewer.render.scene import Scene
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import convert_to_screen_pixels
from enliven_viewer.studio.features.perform.camera_preview import find_side_view_area
from enliven_viewer.studio.viewport.preview_textures import PreviewTextures
from enliven_viewer.studio.viewport.stage_character import StageCharacter
from enliven_viewer.studio.viewport.viewport import Viewport
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import look_in_theme


class WindowPictures:
    """The renderers of a window. They draw into the framebuffer that is bound when the object is created.

    Args:
        films: if True, every image waits until all textures and surfaces are complete. Used for films.

    Attributes:
        source: draws the source take of a mapping, or the side view of a limb.
        glances: textures of the camera previews.
    """

    def __init__(self, workspace: Workspace, *, films: bool) -> None:
        self.workspace = workspace
        settings, context = workspace.editor.settings, get_window_context()
        # Detect the framebuffer now, while the window's framebuffer is bound.
        self._screen: Any = context.detect_framebuffer()
        passes = [layer.make_pass(context) for layer in workspace.view_layers]
        self.viewport = Viewport(context, (64, 64), settings.render, passes)
        self.viewport.renderer.textures.decodes_in_background = not films
        self.source = Viewport(context, (64, 64), settings.render)
        self._panel_pictures = [make(self.source) for make in workspace.panel_pictures]
        self.glances = PreviewTextures(context)

    def pixels(self) -> UInt8:
        """Returns (H, W, 3) sRGB of the screen, top row first. Call after a frame."""
        width, height = _find_framebuffer_size()
        raw = self._screen.read(viewport=(0, 0, width, height), components=3, alignment=1)
        # Reading the error clears it. moderngl causes it, because it queries buffers that the window lacks.
        _ = self.viewport.renderer.ctx.error
        return np.ascontiguousarray(np.frombuffer(raw, np.uint8).reshape(height, width, 3)[::-1])

    def draw(self, area: Area) -> None:
        """Draws the stage in an area of the window, and the images of the panels."""
        workspace = self.workspace
        editor, perform = workspace.editor, workspace.perform
        stage, live = find_shown_characters(workspace), find_shown_scene(workspace)
        self.source.renderer.look = look_in_theme("studio")
        for draw_pictures in self._panel_pictures:
            draw_pictures()
        renderer = self.viewport.renderer
        renderer.look = look_in_theme(editor.look)
        renderer.resize(convert_to_screen_pixels(area.width, area.height))
        self._draw_side(area, stage, live)
        tool = workspace.input.tool
        self.viewport.draw(
            stage,
            editor.lens,
            editor.selection,
            tool.overlay(),
            over=tool.picture(),
            meshes=editor.show_meshes,
            bones=editor.show_bones and perform.active_workspace in ("Animate", "Model"),
            live=live,
        )
        width, height = _find_framebuffer_size()
        scale = imgui.get_io().display_framebuffer_scale.y
        renderer.present(
            self._screen, (round(area.x * scale), height - round((area.y + area.height) * scale))
        )
        self._screen.viewport = (0, 0, width, height)

    def _draw_side(self, area: Area, stage: Sequence[StageCharacter], live: Scene | None) -> None:
        """Draws the side view of the limb that the next possession attaches. It uses the source view's
        renderer, which is free while performing.
        """
        workspace = self.workspace
        place = find_side_view_area(workspace, area)
        lens = workspace.perform.close_up.lens(place.width, place.height)
        if lens is None:
            return
        self.source.renderer.look = look_in_theme(workspace.editor.look)
        self.source.renderer.resize(convert_to_screen_pixels(place.width, place.height))
        chosen, overlay = workspace.editor.selection, workspace.input.tool.overlay()
        self.source.draw(stage, lens, chosen, overlay, bones=False, live=live)


def find_shown_characters(workspace: Workspace) -> list[StageCharacter]:
    """Returns the characters of the project that are visible on the stage."""
    if _hides_characters(workspace):
        return []
    hidden = workspace.perform.hidden
    return [character for character in workspace.editor.visible_characters if character.id not in hidden]


def find_shown_scene(workspace: Workspace) -> Scene | None:
    """Returns the scene of an edge or a take if it is visible."""
    live = None if workspace.perform.hides_live else workspace.perform.scene
    if live is None or not _hides_characters(workspace):
        return live
    return replace(live, actors=(), boards={})


def _hides_characters(workspace: Workspace) -> bool:
    """Returns True if a feature hides the characters, for example to show a growing scan."""
    return any(layer.hides_characters() for layer in workspace.view_layers)


def _find_framebuffer_size() -> tuple[int, int]:
    """Returns the size of the window's framebuffer in screen pixels."""
    io = imgui.get_io()
    scale = io.display_framebuffer_scale
    return round(io.display_size.x * scale.x), round(io.display_size.y * scale.y)
