"""Renders the images of a window: the stage, and the panels' images of takes and performers."""

from __future__ import annotations

from typing import Any

import numpy as np
from imgui_bundle import imgui

from enliven.arrays import UInt8
from enliven_viewer.render.gl.context import get_window_context
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import convert_to_screen_pixels
from enliven_viewer.studio.app.workspace_tabs import has_tools
from enliven_viewer.studio.viewport.viewport import Viewport
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import look_in_theme


class WindowPictures:
    """The renderers of a window. They draw into the framebuffer that is bound when the object is created.

    Args:
        films: if True, every image waits until all textures and surfaces are complete. Used for films.

    Attributes:
        source: draws the images of the panels.
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
        editor = workspace.editor
        stage, live = workspace.shown_characters, workspace.shown_scene
        self.source.renderer.look = look_in_theme("studio")
        for draw_pictures in reversed(self._panel_pictures):
            draw_pictures()
        renderer = self.viewport.renderer
        renderer.look = look_in_theme(editor.look)
        renderer.resize(convert_to_screen_pixels(area.width, area.height))
        tool = workspace.input.tool
        self.viewport.draw(
            stage,
            editor.lens,
            editor.selection,
            tool.overlay(),
            over=tool.picture(),
            meshes=editor.show_meshes,
            bones=editor.show_bones and has_tools(workspace.tabs.active),
            live=live,
        )
        width, height = _find_framebuffer_size()
        scale = imgui.get_io().display_framebuffer_scale.y
        renderer.present(
            self._screen, (round(area.x * scale), height - round((area.y + area.height) * scale))
        )
        self._screen.viewport = (0, 0, width, height)


def _find_framebuffer_size() -> tuple[int, int]:
    """Returns the size of the window's framebuffer in screen pixels."""
    io = imgui.get_io()
    scale = io.display_framebuffer_scale
    return round(io.display_size.x * scale.x), round(io.display_size.y * scale.y)
