"""A feature of the studio for tests: an action, a tool, a panel and an overlay."""

from imgui_bundle import ImVec2, imgui

from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.contributions import Panel, ViewOverlay
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import open_panel
from enliven_viewer.studio.tools.base import Tool

COLOUR = (255, 0, 255)
"""Colour of the overlay, which no theme of the studio uses."""
SIDE = 40.0
"""Side length in pixels of the overlay's square."""


class Gauge:
    """The feature's state: True while the gauge is shown, and the number of frames."""

    def __init__(self) -> None:
        self.is_shown, self.frames = False, 0

    def toggle(self) -> None:
        self.is_shown = not self.is_shown

    def count(self) -> None:
        self.frames += 1


class GaugeTool(Tool):
    """A tool without an effect."""

    name, label, key, icon = "gauge", "Gauge", "f9", "\uf0e4"


def register(app: App) -> None:
    """Registers the gauge's action, tool, panel and overlay."""
    gauge = app.add_state(Gauge())

    def draw_panel(area: Area) -> None:
        with open_panel("gauge", area):
            if imgui.button("Close the gauge"):
                gauge.toggle()
            app.remember("gauge back")

    def draw_overlay(area: Area) -> None:
        if gauge.is_shown:
            low = ImVec2(area.x + SIDE, area.y + 3 * SIDE)
            colour = imgui.get_color_u32((*(value / 255 for value in COLOUR), 1.0))
            high = ImVec2(low.x + SIDE, low.y + SIDE)
            imgui.get_background_draw_list().add_rect_filled(low, high, colour)

    app.actions.add(
        Action("gauge.show", "Gauge", "Show it", ("ctrl+f9",), gauge.toggle, is_on=lambda: gauge.is_shown)
    )
    app.add_tool(GaugeTool)
    app.panels.append(
        Panel("gauge", draw_panel, lambda: gauge.is_shown, ("Perform", "Animate"), "gauge back")
    )
    app.overlays.append(ViewOverlay(draw_overlay))
    app.frame_tasks.append(gauge.count)
