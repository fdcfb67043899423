"""The command palette: finds any action by letters of its name."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.app.style import pack_colour
from enliven_viewer.studio.panels.modal import open_modal
from enliven_viewer.studio.workspace.workspace import Workspace
from enliven_viewer.theme import FAINT, INK, QUIET

_DIALOG_SIZE = (600.0, 420.0)
"""Size of the palette in pixels. It fits a dozen rows with name, menu and shortcut."""


def draw_palette(workspace: Workspace) -> None:
    """Draws the palette while it is open."""
    with open_modal("Find an action", *_DIALOG_SIZE) as shown:
        if not shown:
            return
        finding = workspace.finding
        if imgui.is_window_appearing() or workspace.finding.refused:
            workspace.finding.refused = False
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(-1)
        entered, typed = imgui.input_text_with_hint(
            "##typed",
            tr("Type a few letters of a command"),
            finding.typed,
            imgui.InputTextFlags_.enter_returns_true,
        )
        workspace.remember("palette")
        finding.set_text(typed)
        moved = imgui.is_key_pressed(imgui.Key.down_arrow) - imgui.is_key_pressed(imgui.Key.up_arrow)
        if moved:
            finding.move_highlight(moved)
        imgui.begin_child("##found")
        picked = None
        for number, action in enumerate(finding.matches):
            if _draw_row(workspace, action, number == finding.highlighted, bool(moved)):
                finding.highlighted, picked = number, action
        if not finding.matches:
            imgui.text_disabled(tr("No name contains this text."))
        imgui.end_child()
        if entered or picked is not None:
            _run_highlighted(workspace)
        elif imgui.is_key_pressed(imgui.Key.escape):
            workspace.cancel()


def _run_highlighted(workspace: Workspace) -> None:
    """Runs the highlighted action if it is available, and closes the palette."""
    action = workspace.finding.highlighted_action()
    if action is not None:
        workspace.cancel()
        workspace.actions.do(action.id)
    else:
        workspace.finding.refused = True


def _draw_row(workspace: Workspace, action: Action, marked: bool, follow: bool) -> bool:
    """Draws one action: its name, its shortcut, and its menu or the reason why it is unavailable.

    Returns True if it was clicked.
    """
    reason, key = action.why_not(), workspace.actions.format_shortcut(action)
    position, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    clicked = imgui.selectable(f"##{action.id}", marked, 0, ImVec2(0, 24))[0]
    workspace.remember(f"palette {action.id}")
    if marked and follow:
        imgui.set_scroll_here_y()
    draw_list, font = imgui.get_window_draw_list(), imgui.get_font()
    top = position.y + (24 - imgui.get_font_size()) / 2
    draw_list.add_text(ImVec2(position.x + 6, top), pack_colour(FAINT if reason else INK), tr(action.label))
    left = position.x + 18 + imgui.calc_text_size(tr(action.label)).x
    size = imgui.get_font_size() * 0.85
    max_width = width - (left - position.x) - imgui.calc_text_size(key).x - 20
    draw_list.push_clip_rect(
        ImVec2(left, position.y), ImVec2(left + max(max_width, 0.0), position.y + 24), True
    )
    draw_list.add_text(font, size, ImVec2(left, top + 2), pack_colour(QUIET, 0.7), tr(reason or action.menu))
    draw_list.pop_clip_rect()
    right = position.x + width - imgui.calc_text_size(key).x - 6
    draw_list.add_text(ImVec2(right, top), pack_colour(FAINT if reason else QUIET), key)
    return bool(clicked)
