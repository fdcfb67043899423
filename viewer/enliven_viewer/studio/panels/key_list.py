"""The list of all shortcuts, built from the actions."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import tr
from enliven_viewer.studio.actions.table import ActionTable
from enliven_viewer.studio.app.style import draw_note
from enliven_viewer.studio.panels.modal import draw_button, open_modal
from enliven_viewer.studio.workspace.workspace import Workspace

_DIALOG_SIZE = (1000.0, 580.0)
"""Size of the dialogue in pixels. It fits three columns, and the longest column without scrolling."""
_COLUMN_WIDTH = 320.0
"""Width of a column in pixels. It fits the longest name next to its shortcut."""
_KEY_WIDTH = 122.0
"""Width of a shortcut in pixels. It fits Ctrl+Shift+Z."""
_COLUMN_GAP = 20.0
"""Gap in pixels between a name, which wraps if it is long, and the next column."""
_MOUSE_ACTIONS = (
    ("Right drag", "Turn the view"),
    ("Middle drag", "Move the view"),
    ("Wheel", "Closer, or further away"),
)


def draw_key_list(workspace: Workspace) -> None:
    """Draws the list in as many columns as fit. It scrolls in a small window."""
    parts = make_parts(workspace.actions)
    with open_modal("Keys", *_DIALOG_SIZE) as shown:
        if not shown:
            return
        imgui.begin_child("##all", ImVec2(0, -imgui.get_frame_height() - 10))
        count = max(min(int(imgui.get_content_region_avail().x / _COLUMN_WIDTH), 3), 1)
        for column in _split_columns([*parts, (tr("Mouse"), list(_MOUSE_ACTIONS))], count):
            imgui.begin_group()
            imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + _COLUMN_WIDTH - _COLUMN_GAP)
            for title, lines in column:
                draw_note(title.upper())
                for key, label in lines:
                    imgui.text_unformatted(tr(key))
                    imgui.same_line(_KEY_WIDTH)
                    imgui.text_disabled(tr(label))
                imgui.dummy(ImVec2(_COLUMN_WIDTH, 4))
            imgui.pop_text_wrap_pos()
            imgui.end_group()
            imgui.same_line()
        imgui.end_child()
        if draw_button(workspace, "Close") or imgui.is_key_pressed(imgui.Key.escape):
            workspace.cancel()


Part = tuple[str, list[tuple[str, str]]]
"""A title, and a list of (shortcut, name)."""


def make_parts(actions: ActionTable) -> list[Part]:
    """Returns the shortcuts of each menu.

    Those of single workspaces are listed separately, under the workspaces' names.
    """
    parts: dict[str, list[tuple[str, str]]] = {}
    for menu, listed in actions.menus.items():
        for action in listed:
            title = (
                tr("{0}: shortcuts in {1}", tr(menu), ", ".join(map(tr, action.workspaces)))
                if action.workspaces
                else tr(menu)
            )
            if actions.find_shortcuts(action):
                parts.setdefault(title, []).append((actions.format_shortcut(action), tr(action.label)))
    return list(parts.items())


def _split_columns(parts: list[Part], count: int) -> list[list[Part]]:
    """Returns the parts in order, in columns of about equal length."""
    lines_per_column = sum(len(lines) + 2 for _, lines in parts) / count
    columns: list[list[Part]] = [[]]
    used_lines = 0
    for part in parts:
        if (
            columns[-1]
            and used_lines + len(part[1]) / 2 > lines_per_column * len(columns)
            and len(columns) < count
        ):
            columns.append([])
        columns[-1].append(part)
        used_lines += len(part[1]) + 2
    return columns
