"""Draws the start page, and the text on an empty stage, over the view."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import labelled, tr
from enliven_viewer.studio.app.fields import draw_action_button
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import BODY_TEXT_SIZE, draw_heading, draw_note, pack_colour
from enliven_viewer.studio.workspace.files import SAMPLES
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import INK, QUIET

_PAGE_WIDTH = 560.0
"""Width of the start page in pixels: two columns of buttons."""
_COLUMN_WIDTH = 250.0
"""Width in pixels of a column and of its buttons, if there is enough space."""
_MIN_COLUMN_WIDTH = 200.0
"""Minimum width in pixels of a column. It fits the longest button. On a narrower page, one column is below
the other.
"""
_COLUMN_GAP = 24.0
"""Gap in pixels between the two columns."""
_EDGE_MARGIN = 14.0
"""Distance in pixels between a card and the border of the view."""
_MAX_RECENT_FILES = 5
"""Maximum number of recent files on the start page; the menu has all."""
_WINDOW_FLAGS = (
    imgui.WindowFlags_.no_title_bar
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_focus_on_appearing
)
_FIRST_ACTIONS = ("perform.stand", "tool.sketch", "file.open", "help.tour")
"""The actions on the start page. Actions that are missing from the table are omitted."""


def draw_start(workspace: Workspace, area: Area) -> None:
    """Draws the start page if it is open or a feature needs it. Otherwise draws the text on an empty
    stage.
    """
    wanted = workspace.wants_start_page()
    if wanted:
        _draw_page(workspace, area)
        return
    if workspace.editor.project.characters or workspace.input.tool.name != "choose":
        return
    if workspace.starting:
        _draw_page(workspace, area)
    elif wanted is None:
        _draw_empty_view(area)


def _draw_page(workspace: Workspace, area: Area) -> None:
    middle = ImVec2(area.x + area.width / 2, area.y + area.height / 2)
    imgui.set_next_window_pos(middle, imgui.Cond_.always, ImVec2(0.5, 0.5))
    width, height = min(_PAGE_WIDTH, area.width - 2 * _EDGE_MARGIN), area.height - 2 * _EDGE_MARGIN
    # The page is as tall as its contents. In a small window it scrolls.
    imgui.set_next_window_size_constraints(ImVec2(width, 0), ImVec2(width, max(height, 1.0)))
    imgui.set_next_window_size(ImVec2(width, 0))
    imgui.begin(labelled(tr("Start"), "Start"), None, _WINDOW_FLAGS)
    available_width = imgui.get_content_region_avail().x
    column = min(_COLUMN_WIDTH, (available_width - _COLUMN_GAP) / 2)
    is_narrow = column < _MIN_COLUMN_WIDTH
    column = available_width if is_narrow else column
    imgui.push_font(None, 22.0)
    imgui.push_text_wrap_pos(0.0)
    imgui.text(tr("Bring something to life"))
    imgui.pop_text_wrap_pos()
    imgui.pop_font()
    imgui.push_font(None, BODY_TEXT_SIZE * _find_text_scale(workspace, column))
    imgui.begin_group()
    draw_heading("Begin")
    for name in _FIRST_ACTIONS:
        if name in workspace.actions:
            draw_action_button(workspace, name, column)
    imgui.end_group()
    if not is_narrow:
        imgui.same_line(0.0, _COLUMN_GAP)
    imgui.begin_group()
    draw_heading("Samples")
    for name in SAMPLES:
        draw_action_button(workspace, f"sample.{name}", column)
    _draw_recent_files(workspace, column)
    imgui.end_group()
    imgui.pop_font()
    imgui.dummy(ImVec2(0, 4))
    low, size = imgui.get_window_pos(), imgui.get_window_size()
    workspace.drawn.record("start page", (low.x, low.y, low.x + size.x, low.y + size.y))
    imgui.end()


def _find_text_scale(workspace: Workspace, column: float) -> float:
    """Returns the text scale, at most 1, at which all buttons fit a column."""
    names = [*_FIRST_ACTIONS, *(f"sample.{name}" for name in SAMPLES)]
    labels = [tr(workspace.actions[name].label) for name in names if name in workspace.actions]
    max_width = column - 2 * imgui.get_style().frame_padding.x
    return min(1.0, max_width / max(imgui.calc_text_size(label).x for label in labels))


def _draw_recent_files(workspace: Workspace, column: float) -> None:
    draw_heading("Recent")
    paths = [Path(name) for name in workspace.preferences.recent[:_MAX_RECENT_FILES]]
    if not paths:
        draw_note("Files that you open or save are listed here. You can also drop files onto the window.")
    for number, path in enumerate(paths):
        if imgui.selectable(f"{path.name}###recent {number}", False, 0, ImVec2(column, 0))[0]:
            workspace.run_and_report(lambda path=path: workspace.open(path))
        workspace.remember(f"start {path.name}")
        imgui.set_item_tooltip(str(path.parent))


def _draw_empty_view(area: Area) -> None:
    """Draws instructions in the middle of an empty view."""
    draw_list = imgui.get_background_draw_list()
    lines = (
        tr("The project is empty"),
        tr("Press S and draw a shape, or drop a file here. Ctrl+O opens a file."),
    )
    for k, (text, colour) in enumerate(zip(lines, (INK, QUIET), strict=True)):
        width = imgui.calc_text_size(text).x
        position = ImVec2(area.x + (area.width - width) / 2, area.y + area.height * 0.42 + 24 * k)
        draw_list.add_text(position, pack_colour(colour), text)
