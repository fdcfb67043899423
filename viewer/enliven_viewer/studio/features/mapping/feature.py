"""Registers retargeting: the tool that maps motion, the view of the take, and suggested matches."""

from __future__ import annotations

from collections.abc import Callable

from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.contributions import Panel, ViewOverlay
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.features.mapping.map_tool import MapTool
from enliven_viewer.studio.viewport.viewport import Viewport


def register(app: App) -> None:
    """Registers retargeting."""
    panels = MappingPanels(app, app.add_tool(MapTool, after="cut"))
    app.show_take = panels.show_take
    app.panel_pictures.append(panels.make_pictures)
    app.panels.append(Panel("source", panels.draw_source, panels.is_shown, place="below outliner"))
    app.overlays.append(ViewOverlay(panels.draw_matches))


class MappingPanels:
    """The panel of the take with its image, and the matches over the view.

    The drawing module is imported late, so that a workspace without a window works without ImGui.
    """

    def __init__(self, app: App, tool: MapTool) -> None:
        self._app, self._tool = app, tool
        self._view: Viewport | None = None
        self._is_drawn = False

    def is_shown(self) -> bool:
        """Returns True if the tool is active."""
        return self._app.input.tool is self._tool

    def show_take(self, name: str) -> None:
        """Activates the tool, and shows a take."""
        self._app.input.activate_tool(self._tool.name)
        self._tool.source.show(name)

    def make_pictures(self, view: Viewport) -> Callable[[], object]:
        """Returns the function that draws the image of the take, once per frame."""
        from enliven_viewer.studio.app.style import convert_to_screen_pixels

        self._view = view

        def draw() -> None:
            source = self._tool.source
            posed = source.make_posed_skeleton() if self.is_shown() else None
            if posed is not None:
                view.renderer.resize(convert_to_screen_pixels(*source.size))
                view.draw([posed], source.lens, source.selection, source.overlay())

        return draw

    def draw_source(self, area: Area) -> None:
        """Draws the view of the take."""
        from enliven_viewer.studio.features.mapping.panel import draw_source

        texture = None if self._view is None else self._view.renderer.picture.texture.glo
        draw_source(self._app, self._tool, area, texture)
        self._is_drawn = True

    def draw_matches(self, area: Area) -> None:
        """Draws the suggested matches over the view if the panel is drawn, too."""
        from enliven_viewer.studio.features.mapping.panel import draw_matches

        if self._is_drawn and self._tool.offered:
            draw_matches(self._app, self._tool, area)
        self._is_drawn = False
