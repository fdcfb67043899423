"""Draws the outliner: a filter, and a row for every object."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import draw_tooltip
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import (
    CLOSED_EYE_ICON,
    EYE_ICON,
    open_panel,
    pack_colour,
    push_colours,
    use_small_text,
)
from enliven_viewer.studio.editor.takes import delete_take_row
from enliven_viewer.studio.features.outliner.outliner import Outliner
from enliven_viewer.studio.features.outliner.tree import CHARACTER, GROUP, HANDLE, LIVE, TAKE, Row
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.viewport.colours import choose_default_colour
from enliven_viewer.theme import ACCENT, CLEAR, FAINT, INK, QUIET

_MIN_HEIGHT_FRACTION = 0.12
"""Minimum fraction of the side panel's height for the tree. It fits the filter, and in a tall window also a
row.
"""
_MAX_HEIGHT_FRACTION = 0.85
"""Maximum fraction of the side panel's height for the tree, so that the selection's name stays visible."""
_SPLITTER_HEIGHT = 7.0
"""Height in pixels of the draggable line between the tree and the selection."""
_INDENT_WIDTH = 14.0
"""Indentation in pixels per level."""
_FOLD_WIDTH = 16.0
"""Width in pixels of the arrow that folds a row."""
_SWITCH_WIDTH = 20.0
"""Width in pixels of a visibility or lock icon."""
_ROW_HEIGHT = 20.0
"""Height of a row in pixels: a line of text with a margin."""
_OPENED_ICON, _CLOSED_ICON = "\uf0d7", "\uf0da"
_LOCKED_ICON, _UNLOCKED_ICON = "\uf023", "\uf09c"
_BONE_ICON, _POINT_ICON, _FILM_ICON, _PERSON_ICON, _TRASH_ICON = (
    "\uf069",
    "\uf111",
    "\uf008",
    "\uf007",
    "\uf014",
)
_DRAG_PAYLOAD = "character"
"""Payload type of a dragged row."""


def draw_outliner(app: App, outliner: Outliner, area: Area) -> None:
    """Draws the tree. The line below it can be dragged to change the tree's height."""
    leading = app.editor.selection.character
    outliner.followed, follow = leading, leading != outliner.followed
    with open_panel(
        "outliner", area, imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse
    ):
        _draw_filter(app, outliner)
        divided = area.height < app.side_split.column.height
        imgui.begin_child("rows", ImVec2(0, -_SPLITTER_HEIGHT if divided else 0))
        imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(4, 1))
        for row in outliner.rows:
            _draw_row(app, outliner, row)
            if follow and row.kind == CHARACTER and row.id == leading and not imgui.is_item_visible():
                imgui.set_scroll_here_y(0.5)
        if not app.editor.project.characters and not outliner.typed:
            with use_small_text(), push_colours(QUIET, imgui.Col_.text):
                imgui.text_wrapped(
                    tr("The project is empty. Sketch a part (S), or open a model or a mesh (Ctrl+O).")
                )
        if outliner.typed and not outliner.rows:
            imgui.text_disabled(tr("No name contains this text."))
        imgui.pop_style_var()
        imgui.end_child()
        if divided:
            _handle_splitter(app, area)


def _handle_splitter(app: App, area: Area) -> None:
    """Draws the line between the tree and the selection."""
    imgui.set_cursor_pos(ImVec2(0, area.height - _SPLITTER_HEIGHT))
    imgui.invisible_button("##grip", ImVec2(area.width, _SPLITTER_HEIGHT))
    app.remember("grip")
    held = imgui.is_item_active()
    if held or imgui.is_item_hovered():
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ns)
    if held:
        side = app.side_split.column
        fraction = (imgui.get_mouse_pos().y - side.y + _SPLITTER_HEIGHT / 2) / side.height
        app.side_split.fraction = min(max(fraction, _MIN_HEIGHT_FRACTION), _MAX_HEIGHT_FRACTION)
    y, low = area.y + area.height - _SPLITTER_HEIGHT / 2, ImVec2(area.x + area.width / 2 - 16, 0)
    start, end = ImVec2(low.x, y), ImVec2(low.x + 32, y)
    imgui.get_window_draw_list().add_line(start, end, pack_colour(ACCENT if held else QUIET, 0.6), 2.0)


def _draw_filter(app: App, outliner: Outliner) -> None:
    imgui.set_next_item_width(-1)
    with use_small_text():
        outliner.typed = imgui.input_text_with_hint(
            "##filter", tr("\uf002  Filter by name"), outliner.typed, imgui.InputTextFlags_.escape_clears_all
        )[1]
    app.remember("filter")


def _draw_row(app: App, outliner: Outliner, row: Row) -> None:
    """Draws one row: arrow, icon, name, note, visibility and lock."""
    imgui.push_id(row.key)
    left, width = imgui.get_cursor_pos_x(), imgui.get_content_region_avail().x
    position = imgui.get_cursor_screen_pos()
    switches = _SWITCH_WIDTH * {CHARACTER: 2, TAKE: 1, GROUP: int(row.id == "live")}.get(row.kind, 0)
    start = left + _INDENT_WIDTH * row.depth
    imgui.set_next_item_allow_overlap()
    size = ImVec2(width - switches, _ROW_HEIGHT)
    clicked = imgui.selectable(f"##{row.key}", outliner.is_chosen(row), 0, size)[0]
    hovered, twice = imgui.is_item_hovered(), imgui.is_mouse_double_clicked(0)
    app.remember(row.key)
    on_arrow = row.folds and imgui.get_mouse_pos().x < position.x + _INDENT_WIDTH * row.depth + _FOLD_WIDTH
    if clicked:
        _handle_click(app, outliner, row, fold=on_arrow or row.kind == GROUP)
    if hovered and twice and not on_arrow:
        outliner.begin_rename(row)
    if row.kind == CHARACTER:
        _handle_drag(outliner, row)
    if outliner.renaming == row.key:
        imgui.same_line(start + _FOLD_WIDTH)
        _draw_rename_field(app, outliner, row)
    else:
        _draw_row_texts(outliner, row, position, width - switches)
    if row.kind == CHARACTER:
        _draw_switches(app, outliner, row, left + width)
    elif row.kind == TAKE:
        imgui.same_line(left + width - _SWITCH_WIDTH)
        if _draw_switch(app, f"delete {row.id}", _TRASH_ICON, False):
            delete_take_row(app.editor, row.id)
        draw_tooltip("Deletes this take. It is unused, or its lane has other takes")
    elif switches:
        imgui.same_line(left + width - _SWITCH_WIDTH)
        perform = app.state(PerformSession)
        if _draw_switch(
            app, "live", CLOSED_EYE_ICON if perform.live_hidden else EYE_ICON, perform.live_hidden
        ):
            perform.live_hidden = not perform.live_hidden
        draw_tooltip("Shows the live stage while you animate and model")
    imgui.pop_id()


def _draw_row_texts(outliner: Outliner, row: Row, position: ImVec2, width: float) -> None:
    """Draws the arrow, icon, name and note, clipped at the end of the row."""
    draw_list, x = imgui.get_window_draw_list(), position.x + _INDENT_WIDTH * row.depth
    label, note = tr(row.label) if row.kind == GROUP else row.label, tr(row.note)
    middle = position.y + (_ROW_HEIGHT - imgui.get_font_size()) / 2
    draw_list.push_clip_rect(position, ImVec2(position.x + width, position.y + _ROW_HEIGHT), True)
    if row.folds:
        opened = row.key in outliner.opened or bool(outliner.typed)
        draw_list.add_text(
            ImVec2(x + 3, middle), pack_colour(QUIET), _OPENED_ICON if opened else _CLOSED_ICON
        )
    x += _FOLD_WIDTH
    faint = row.kind == CHARACTER and outliner.find_handling(row.id).hidden
    if row.kind == CHARACTER:
        tint = choose_default_colour(row.id)
        colour = (tint[0] / 255, tint[1] / 255, tint[2] / 255, 0.4 if faint else 1.0)
        draw_list.add_rect_filled(
            ImVec2(x, position.y + 5), ImVec2(x + 11, position.y + _ROW_HEIGHT - 5), pack_colour(colour), 3.0
        )
        x += 17
    elif row.kind != GROUP:
        sign = {TAKE: _FILM_ICON, LIVE: _PERSON_ICON}.get(
            row.kind, _POINT_ICON if row.note == "point" else _BONE_ICON
        )
        size = imgui.get_font_size() * 0.7
        draw_list.add_text(imgui.get_font(), size, ImVec2(x, middle + 3), pack_colour(QUIET, 0.7), sign)
        x += 17
    ink = QUIET if row.kind == GROUP else FAINT if faint else INK
    draw_list.add_text(ImVec2(x, middle), pack_colour(ink), label)
    x += imgui.calc_text_size(label).x + 8
    size = imgui.get_font_size() * 0.82
    wide = imgui.calc_text_size(note).x * 0.82
    # Align the notes at the right, so that they are easy to compare. If there is too little space, a note
    # follows the name directly.
    aside = ImVec2(max(x, position.x + width - wide - 6), middle + 2)
    draw_list.add_text(imgui.get_font(), size, aside, pack_colour(QUIET, 0.75), note)
    draw_list.pop_clip_rect()


def _handle_click(app: App, outliner: Outliner, row: Row, *, fold: bool) -> None:
    """Folds a row, shows a take next to the shapes, or selects the row's object."""
    io = imgui.get_io()
    if fold and row.folds:
        outliner.toggle_folded(row)
    elif row.kind == TAKE and not imgui.is_mouse_double_clicked(0):
        app.show_take(row.id)
    elif row.kind in (CHARACTER, HANDLE):
        outliner.click(row, shift=io.key_shift, ctrl=io.key_ctrl)
        is_single = not app.editor.selection.has_several
        if is_single and get_puppet_editor(app.editor).puppet is not None:
            app.input.activate_tool("puppet")


def _draw_rename_field(app: App, outliner: Outliner, row: Row) -> None:
    """Draws the field of a name that is edited in place. Enter, or a click elsewhere, accepts it."""
    if not imgui.is_any_item_active():
        imgui.set_keyboard_focus_here()
    imgui.set_next_item_width(-_SWITCH_WIDTH * 2 if row.kind == CHARACTER else -1)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(4, 1))
    flags = imgui.InputTextFlags_.auto_select_all | imgui.InputTextFlags_.enter_returns_true
    entered, outliner.draft = imgui.input_text("##renamed", outliner.draft, flags)
    imgui.pop_style_var()
    app.remember("renamed")
    if imgui.is_key_pressed(imgui.Key.escape):
        outliner.end_rename(row, keep=False)
    elif entered or imgui.is_item_deactivated():
        outliner.end_rename(row, keep=True)


def _draw_switches(app: App, outliner: Outliner, row: Row, right: float) -> None:
    """Draws the visibility and lock icons of a character.

    A click applies to the whole selection if that contains it.
    """
    now, chosen = outliner.find_handling(row.id), app.editor.selection.characters
    names = chosen if row.id in chosen else (row.id,)
    imgui.same_line(right - 2 * _SWITCH_WIDTH)
    if _draw_switch(app, f"eye {row.id}", CLOSED_EYE_ICON if now.hidden else EYE_ICON, now.hidden):
        outliner.set_hidden(*names, is_hidden=not now.hidden)
    draw_tooltip(
        "Shows the item again"
        if now.hidden
        else "Hides the item in this window only. Exports and the stage do not change"
    )
    imgui.same_line(right - _SWITCH_WIDTH)
    if _draw_switch(app, f"lock {row.id}", _LOCKED_ICON if now.locked else _UNLOCKED_ICON, now.locked):
        outliner.set_locked(*names, is_locked=not now.locked)
    draw_tooltip(
        "Unlocks the item" if now.locked else "Locks the item, so that it cannot be picked or edited"
    )


def _draw_switch(app: App, name: str, icon: str, on: bool) -> bool:
    """Draws one small frameless toggle button, bright while it is on. Returns True if it was clicked."""
    with (
        push_colours(CLEAR, imgui.Col_.button),
        push_colours(ACCENT if on else FAINT, imgui.Col_.text),
        use_small_text(),
    ):
        imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(1, 2))
        is_pressed = imgui.button(f"{icon}###{name}", ImVec2(_SWITCH_WIDTH - 2, _ROW_HEIGHT - 1))
        imgui.pop_style_var()
    app.remember(name)
    return bool(is_pressed)


def _handle_drag(outliner: Outliner, row: Row) -> None:
    """Handles the drag of a row onto another row, which moves its character to that position."""
    if imgui.begin_drag_drop_source():
        imgui.set_drag_drop_payload_py_id(_DRAG_PAYLOAD, outliner.find_place(row.id))
        imgui.text_unformatted(row.id)
        imgui.end_drag_drop_source()
    if imgui.begin_drag_drop_target():
        dropped = imgui.accept_drag_drop_payload_py_id(_DRAG_PAYLOAD)
        names = list(outliner.editor.project.characters)
        if dropped is not None and 0 <= dropped.data_id < len(names):
            outliner.move(names[dropped.data_id], outliner.find_place(row.id))
        imgui.end_drag_drop_target()
