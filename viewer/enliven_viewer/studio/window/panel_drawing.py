"""Lays out and draws the panels of a window."""

from __future__ import annotations

from imgui_bundle import imgui

from enliven_viewer.studio.app.contributions import PanelPlace
from enliven_viewer.studio.app.panel_layout import TIMELINE_HEIGHT, Area, PanelLayout, lay_out_panels
from enliven_viewer.studio.app.workspace_tabs import has_tools
from enliven_viewer.studio.panels.menu import draw_menu, draw_workspace_tabs
from enliven_viewer.studio.panels.side import draw_side
from enliven_viewer.studio.panels.toolbar import draw_toolbar
from enliven_viewer.studio.panels.viewport_overlay import draw_overlay, draw_progress_box
from enliven_viewer.studio.workspace.workspace import Workspace

_HIDDEN_PANELS: dict[str, tuple[str, ...]] = {
    "Perform": ("tools",),
    "Animate": (),
    "Model": ("timeline",),
    "Play": ("tools", "side"),
}
"""The panels that each workspace hides."""
_LOWER_HEIGHT_FRACTION = 0.56
"""Fraction of the side panel's height below the outliner, so that the list of shapes still fits above."""
_MIN_SPLIT_HEIGHT = 340.0
"""Panel height in pixels below which the panel below the outliner takes all of it."""


def make_panel_layout(workspace: Workspace, *, bare: bool) -> PanelLayout:
    """Returns the layout of the panels at the window's size. A bare window has only the view."""
    size, active_workspace = imgui.get_io().display_size, workspace.tabs.active
    without = ("menu", "tools", "side", "timeline") if bare else _HIDDEN_PANELS[active_workspace]
    without = (*without, *(name for find_hidden in workspace.hidden_panels for name in find_hidden()))
    options = {
        "puppet": workspace.find_panel(active_workspace, "beside view") is not None,
        "curves": workspace.find_panel(active_workspace, "above timeline") is not None,
        "hinted": not bare and has_tools(active_workspace),
    }
    height = workspace.preferences.timeline_height or TIMELINE_HEIGHT
    return lay_out_panels(size.x, size.y, without=without, timeline_height=height, **options)


def draw_panels(workspace: Workspace, places: PanelLayout) -> None:
    """Draws the menu and the panels of the workspace."""
    active_workspace = workspace.tabs.active
    draw_menu(workspace)
    draw_workspace_tabs(workspace)
    if places.tools.width:
        draw_toolbar(workspace, places.tools)
    panel = workspace.find_panel(active_workspace)
    if panel is not None and places.side.width:
        panel.draw(places.side)
    elif places.side.width:
        _draw_side(workspace, places)
    areas: tuple[tuple[PanelPlace, Area | None], ...] = (
        ("bottom", places.timeline if places.timeline.height else None),
        ("above timeline", places.curves),
        ("beside view", places.performer),
        ("below view", places.strip),
    )
    for place, area in areas:
        panel = workspace.find_panel(active_workspace, place)
        if panel is not None and area is not None:
            panel.draw(area)
    draw_progress_box(workspace, places.viewport)
    draw_overlay(workspace, places.viewport, tool=has_tools(active_workspace), hint=places.hint)


def _draw_side(workspace: Workspace, places: PanelLayout) -> None:
    """Draws the outliner, with the selection below it."""
    column, active_workspace = places.side, workspace.tabs.active
    below_outliner = workspace.find_panel(active_workspace, "below outliner")
    if below_outliner is not None:
        column, below = _split_side(column)
        below_outliner.draw(below)
    above, below = workspace.side_split.divide(column)
    chosen = workspace.editor.selection
    if chosen.character is None or (column is not places.side and chosen.layer is None):
        # Nothing is selected, or there is room only for the tree and the source view. So the tree takes the
        # whole column.
        above = column
    elif (selection := workspace.find_panel(active_workspace, "selection")) is not None:
        selection.draw(below)
    else:
        draw_side(workspace, below)
    outliner = workspace.find_panel(active_workspace, "outliner")
    if outliner is not None and above.height >= 1.0:
        outliner.draw(above)


def _split_side(side: Area) -> tuple[Area, Area]:
    """Splits the right panel: the outliner above, another panel below."""
    height = side.height if side.height < _MIN_SPLIT_HEIGHT else round(_LOWER_HEIGHT_FRACTION * side.height)
    above = Area(side.x, side.y, side.width, side.height - height)
    return above, Area(side.x, side.y + side.height - height, side.width, height)
