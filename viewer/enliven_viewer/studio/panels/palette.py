"""The command palette: finds any action by letters of its name."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.actions import Action
from enliven_viewer.studio.panels.modal import modal
from enliven_viewer.studio.panels.style import packed
from enliven_viewer.studio.workspace import Workspace
from enliven_viewer.theme import FAINT, INK, QUIET

_SIZE = (600.0, 420.0)
"""Size in pixels: a dozen rows with name, menu and shortcut side by side."""


def draw_palette(workspace: Workspace) -> None:
    """Draws the palette while it is open."""
    with modal("Find an action", *_SIZE) as shown:
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
        finding.type(typed)
        moved = imgui.is_key_pressed(imgui.Key.down_arrow) - imgui.is_key_pressed(imgui.Key.up_arrow)
        if moved:
            finding.step(moved)
        imgui.begin_child("##found")
        picked = None
        for number, action in enumerate(finding.matches):
            if _row(workspace, action, number == finding.marked, bool(moved)):
                finding.marked, picked = number, action
        if not finding.matches:
            imgui.text_disabled(tr("Nothing has this name."))
        imgui.end_child()
        if entered or picked is not None:
            _do(workspace)
        elif imgui.is_key_pressed(imgui.Key.escape):
            workspace.cancel()


def _do(workspace: Workspace) -> None:
    """Runs the highlighted action if it is available, and closes the palette."""
    action = workspace.finding.highlighted_action()
    if action is not None:
        workspace.cancel()
        workspace.actions.do(action.id)
    else:
        workspace.finding.refused = True


def _row(workspace: Workspace, action: Action, marked: bool, follow: bool) -> bool:
    """Draws one action: its name, its menu or why it is unavailable, and its shortcut.

    Returns True if it was clicked.
    """
    reason, key = action.why_not(), workspace.actions.shown_key(action)
    at, wide = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    clicked = imgui.selectable(f"##{action.id}", marked, 0, ImVec2(0, 24))[0]
    workspace.remember(f"palette {action.id}")
    if marked and follow:
        imgui.set_scroll_here_y()
    draw, font = imgui.get_window_draw_list(), imgui.get_font()
    top = at.y + (24 - imgui.get_font_size()) / 2
    draw.add_text(ImVec2(at.x + 6, top), packed(FAINT if reason else INK), tr(action.label))
    left = at.x + 18 + imgui.calc_text_size(tr(action.label)).x
    size = imgui.get_font_size() * 0.85
    room = wide - (left - at.x) - imgui.calc_text_size(key).x - 20
    draw.push_clip_rect(ImVec2(left, at.y), ImVec2(left + max(room, 0.0), at.y + 24), True)
    draw.add_text(font, size, ImVec2(left, top + 2), packed(QUIET, 0.7), tr(reason or action.menu))
    draw.pop_clip_rect()
    right = at.x + wide - imgui.calc_text_size(key).x - 6
    draw.add_text(ImVec2(right, top), packed(FAINT if reason else QUIET), key)
    return bool(clicked)
