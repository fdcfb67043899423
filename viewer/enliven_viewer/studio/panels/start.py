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
_LONGEST = max((step.text for step in TOUR), key=len)
"""The text that every card of the tour has room for, so that they are of one size."""
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
        if imgui.selectable(f"{path.name}##{number}", False, 0, ImVec2(column, 0))[0]:
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
    imgui.set_next_window_size(ImVec2(min(_CARD, area.width - 2 * _EDGE), 0))
    imgui.begin("Tour", None, _FLAGS | imgui.WindowFlags_.always_auto_resize)
    done = tour.ticked > 0.0
    with tinted(GOOD if done else ACCENT, imgui.Col_.text):
        imgui.text(f"{chr(0xF00C) if done else tour.number + 1}   {tour.step.title}")
    imgui.begin_group()
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted("Done." if done else tour.text)
    imgui.pop_text_wrap_pos()
    imgui.end_group()
    # A card that changed its size would be cut in the first picture of a step.
    tall = imgui.calc_text_size(_LONGEST, False, imgui.get_content_region_avail().x).y
    imgui.dummy(ImVec2(0.0, max(tall - imgui.get_item_rect_size().y, 0.0)))
    with tinted(ACCENT, imgui.Col_.plot_histogram), tinted(RAISED, imgui.Col_.frame_bg):
        imgui.progress_bar((tour.number + done) / len(TOUR), ImVec2(-1, 4), "")
    if imgui.small_button("Skip this step"):
        tour.skip()
    workspace.remember("tour skip")
    imgui.same_line()
    if imgui.small_button("End the tour"):
        workspace.end_tour()
    workspace.remember("tour end")
    imgui.end()
