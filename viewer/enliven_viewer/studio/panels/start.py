"""The start page, what an empty stage says, and the card of the tour: over the picture."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from enliven_viewer.studio.panels.modal import action_button
from enliven_viewer.studio.panels.style import heading, packed, quiet, tinted
from enliven_viewer.studio.places import Area
from enliven_viewer.studio.start import TOUR
from enliven_viewer.studio.workspace import SAMPLES, Workspace
from enliven_viewer.theme import ACCENT, GOOD, INK, QUIET, RAISED

_PAGE = 560.0
"""Pixels, width of the start page: two columns of buttons."""
_COLUMN = 250.0
"""Pixels of a column and of its buttons, where there is room."""
_BETWEEN = 24.0
"""Pixels between the two columns."""
_BAR = 4.0
"""Pixels of the height of the bar of progress."""
_CARD = 320.0
"""Pixels, width of the tour's card: four lines of text."""
_EDGE = 14.0
"""Pixels between a card and the edge of the picture."""
_MOST_RECENT = 5
"""Recent files on the start page; the menu has all."""
_FLAGS = (
    imgui.WindowFlags_.no_title_bar
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_focus_on_appearing
)
_FIRST = ("perform.stand", "tool.sketch", "file.open", "help.tour")
"""What one begins with; an action that is not in the table is left out."""


def draw_start(workspace: Workspace, area: Area) -> None:
    """Draw the start page or the tour where they are open, and else what an empty stage says."""
    if workspace.tour is not None:
        _tour(workspace, area)
    if workspace.editor.project.characters or workspace.input.tool.name != "choose":
        return
    if workspace.starting:
        _page(workspace, area)
    elif workspace.tour is None:
        _empty(area)


def _page(workspace: Workspace, area: Area) -> None:
    middle = ImVec2(area.x + area.width / 2, area.y + area.height / 2)
    imgui.set_next_window_pos(middle, imgui.Cond_.always, ImVec2(0.5, 0.5))
    imgui.set_next_window_size(ImVec2(min(_PAGE, area.width - 2 * _EDGE), 0))
    imgui.begin("Start", None, _FLAGS)
    column = min(_COLUMN, (imgui.get_content_region_avail().x - _BETWEEN) / 2)
    imgui.push_font(None, 22.0)
    imgui.text("What shall come alive?")
    imgui.pop_font()
    imgui.begin_group()
    heading("Begin")
    for name in _FIRST:
        if name in workspace.actions:
            action_button(workspace, name, column)
    imgui.end_group()
    imgui.same_line(0.0, _BETWEEN)
    imgui.begin_group()
    heading("Samples")
    for name in SAMPLES:
        action_button(workspace, f"sample.{name}", column)
    _recent(workspace, column)
    imgui.end_group()
    imgui.dummy(ImVec2(0, 4))
    imgui.end()


def _recent(workspace: Workspace, column: float) -> None:
    heading("Recent")
    paths = [Path(name) for name in workspace.preferences.recent[:_MOST_RECENT]]
    if not paths:
        quiet("What you open or save is listed here. You can also drop files onto the window.")
    for number, path in enumerate(paths):
        if imgui.selectable(f"{path.name}###recent {number}", False, 0, ImVec2(column, 0))[0]:
            workspace.attempt(lambda path=path: workspace.open(path))
        workspace.remember(f"start {path.name}")
        imgui.set_item_tooltip(str(path.parent))


def _empty(area: Area) -> None:
    """What to do where nothing is there yet, in the middle of the picture."""
    draw = imgui.get_background_draw_list()
    said = ("Nothing is here yet", "Press S and draw a shape, or drop a file here (Ctrl+O opens one).")
    for k, (text, colour) in enumerate(zip(said, (INK, QUIET), strict=True)):
        wide = imgui.calc_text_size(text).x
        at = ImVec2(area.x + (area.width - wide) / 2, area.y + area.height * 0.42 + 24 * k)
        draw.add_text(at, packed(colour), text)


def _tour(workspace: Workspace, area: Area) -> None:
    """The step that is to be done, at the right of the picture; a tick once it was."""
    tour = workspace.tour
    if tour is None or tour.step is None:
        return
    corner = ImVec2(area.x + area.width - _EDGE, area.y + area.height - _EDGE)
    imgui.set_next_window_pos(corner, imgui.Cond_.always, ImVec2(1.0, 1.0))
    done, wide = tour.ticked > 0.0, min(_CARD, area.width - 2 * _EDGE)
    imgui.set_next_window_size(ImVec2(wide, _tall("Done." if done else tour.text, wide)))
    imgui.begin("Tour", None, _FLAGS)
    with tinted(GOOD if done else ACCENT, imgui.Col_.text):
        imgui.text(f"{chr(0xF00C) if done else tour.number + 1}   {tour.step.title}")
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted("Done." if done else tour.text)
    imgui.pop_text_wrap_pos()
    with tinted(ACCENT, imgui.Col_.plot_histogram), tinted(RAISED, imgui.Col_.frame_bg):
        imgui.progress_bar((tour.number + done) / len(TOUR), ImVec2(-1, _BAR), "")
    if imgui.small_button("Skip this step"):
        tour.skip()
    workspace.remember("tour skip")
    imgui.same_line()
    if imgui.small_button("End the tour"):
        workspace.end_tour()
    workspace.remember("tour end")
    imgui.end()


def _tall(text: str, wide: float) -> float:
    """Pixels of the height of a card of the tour; ImGui's own way knows it one picture late, and cuts it."""
    style, line = imgui.get_style(), imgui.get_text_line_height()
    wrapped = imgui.calc_text_size(text, False, wide - 2 * style.window_padding.x).y
    return float(2 * style.window_padding.y + 2 * line + wrapped + _BAR + 3 * style.item_spacing.y)
